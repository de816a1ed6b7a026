"""Data sets of any TDOA system: read from CSV files, tracked, compared with the truth."""
