"""Tests of swarmctl.link."""
