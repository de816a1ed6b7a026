"""Where the emitter is: from range differences and positions to an honest estimate.

No clock, no I/O. Functions take arrays with leading batch axes (trials first), so that a Monte
Carlo run is one call; small classes hold what a live track remembers.

===============  ==============================================================================
``estimate``     the types others are given: ``Estimate``, what it was made from, ``Counts``
``filters``      ``FILTERS``, the filters by name: what makes a track
``model/``       range differences, rows, motion, the receivers' errors, priors
``kernels/``     one update each, as pure functions: the NCRKF, and emitter and receivers together
``track/``       ``Track``, the one loop over the epochs, and the filters that run in it
``feed/``        the live feed of a track: positions aligned, arrivals paired, epochs queued
``integrity/``   what may be believed: the gate, repetition, health
``bounds/``      how good any estimator can be, and whether one is consistent
===============  ==============================================================================

The state is ``x = [e, v]``: the emitter's position (m) and velocity (m/s) in a fixed local
frame of ``d`` = 2 or 3 axes. ``P`` is its covariance.
"""
