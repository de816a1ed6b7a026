"""How good any estimator can be (Cramér-Rao bounds), and whether one is consistent."""
