"""The summary of a flight as a JSON file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import msgspec

SUMMARY_FILE = "summary.json"


def write_summary(directory: Path, summary: Mapping[str, object]) -> Path:
    """Write ``summary.json``, keys sorted, indented; a number that is none becomes null.

    Returns:
        The file written.
    """
    encoded = msgspec.json.encode(dict(summary), order="sorted")
    path = directory / SUMMARY_FILE
    path.write_bytes(msgspec.json.format(encoded, indent=2) + b"\n")
    return path
