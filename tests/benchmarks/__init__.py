"""Benchmarks: run by `make bench`, never by the tests; ratios within one run."""

import os

# Before numpy is loaded, which is when OpenBLAS starts its threads. On matrices this small they
# only wait for each other, and one core is what is measured.
os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"
