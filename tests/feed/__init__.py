"""Tests of the measurement feed."""
