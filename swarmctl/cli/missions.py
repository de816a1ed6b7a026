"""Finding a mission file: a path, or the name of one shipped with the package."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from swarmctl.errors import UsageError


def shipped_missions() -> dict[str, Path]:
    """Paths of the shipped mission files by name."""
    folder = Path(str(resources.files("missions")))
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def find_mission(name: str) -> Path:
    """Path of a mission, given as a path or as the name of a shipped one.

    Raises:
        UsageError: There is neither such a file nor such a shipped mission.
    """
    path = Path(name)
    if path.is_file():
        return path
    shipped = shipped_missions()
    if name in shipped:
        return shipped[name]
    raise UsageError(
        f"{name} is neither a mission file nor a shipped mission ({', '.join(shipped)})."
    )
