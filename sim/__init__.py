"""The truth: vehicles, emitter, receivers and a clock, independent of the controller."""
