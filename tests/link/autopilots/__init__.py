"""Tests of swarmctl.link.autopilots."""
