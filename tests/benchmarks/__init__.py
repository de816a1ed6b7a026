"""Benchmarks: run by `make bench`, never by the tests; ratios within one run."""
