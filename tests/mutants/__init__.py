"""Whether the quick tests notice changes in the modules that matter most: ``make mutants``."""
