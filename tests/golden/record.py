"""Records the golden flights anew: ``python -m tests.golden.record [NAME ...]``.

Only for a change that is meant to alter what the swarm does, which the commit then says.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.golden.flights import FLIGHTS, LONG_FLIGHTS, fly, save


def main() -> None:
    """Record those named, or all."""
    wanted = set(sys.argv[1:])
    for flight in (*FLIGHTS, *LONG_FLIGHTS):
        if wanted and str(flight) not in wanted:
            continue
        with tempfile.TemporaryDirectory() as directory:
            lines = fly(flight, Path(directory) / "flight")
        save(flight, lines)
        print(f"{flight}: {len(lines)} lines, {flight.path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
