"""Filter steps as pure functions: the NCRKF, and the update of emitter and receivers together."""
