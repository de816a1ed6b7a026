"""Where a result comes from: the seed, versions and commit that are stamped on a flight."""

from __future__ import annotations

import platform
import subprocess
from importlib import metadata
from pathlib import Path
from typing import TypedDict

import swarmctl

_PACKAGES = ("numpy", "scipy", "pymavlink", "aiomqtt", "amqtt", "mcap")


class Provenance(TypedDict):
    """Seed of the simulation, versions of what shapes numbers, and the commit."""

    seed: int | None
    versions: dict[str, str]
    commit: str | None


def provenance(seed: int | None) -> Provenance:
    """Seed, versions of swarmctl, Python and the packages that shape numbers, and the commit.

    ``commit`` is None outside a checkout, and ends in ``-dirty`` where files have changed.
    """
    versions = {name: metadata.version(name) for name in _PACKAGES}
    return {
        "seed": seed,
        "versions": {
            "swarmctl": swarmctl.__version__,
            "python": platform.python_version(),
            **versions,
        },
        "commit": _commit(),
    }


def _commit() -> str | None:
    root = Path(swarmctl.__file__).resolve().parents[1]
    if not (root / ".git").exists():
        return None
    try:
        described = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"],
            cwd=root,
            capture_output=True,
            text=True,
            timeout=5.0,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return described.stdout.strip() or None
