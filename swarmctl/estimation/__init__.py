"""Where the emitter is: the range-difference model, the filter, its bound, and a live tracker.

Pure functions of arrays with leading batch axes (trials first, so that a Monte Carlo run is
one call), and two small classes that hold a track. No clock, no I/O.

==================  =========================================================================
``rd_model``        range differences (RDs), their Jacobian and covariances
``motion``          the constant-velocity model
``ncrkf``           the consistent non-conservative robust Kalman filter (NCRKF): one update
``bounds``          the posterior Cramér-Rao bound (PCRB)
``consistency``     NEES, its chi-squared interval, the error ellipse
``estimator``       one live track with clocks, echoes, manoeuvres and health (see there)
``alignment``       a vehicle's position at a measurement's epoch
``pairing``         arrival times of one burst in, RDs out
``tracker``         positions, and RDs or arrival times, in; track out
==================  =========================================================================

The state is ``x = [e, v]``: the emitter's position (m) and velocity (m/s) in a fixed local
frame of ``d`` = 2 or 3 axes. ``P`` is its covariance.
"""
