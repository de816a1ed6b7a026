"""Recordings of any TDOA system: read from CSV files, tracked, judged against the truth."""
