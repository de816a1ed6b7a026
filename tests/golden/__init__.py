"""Golden flights: recorded once, flown again by the suite, compared exactly."""
