"""Filter steps as pure functions: NCRKF, EKF, the update of emitter and receivers together."""
