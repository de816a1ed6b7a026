"""The track: one loop over the epochs, its modes, manoeuvres and window."""
