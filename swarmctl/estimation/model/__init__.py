"""What is measured and how the emitter moves: models, the receivers' errors, priors."""
