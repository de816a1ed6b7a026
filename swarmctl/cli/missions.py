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
    """Path of a mission given as a file's path or a shipped one's name.

    Raises:
        UsageError: If there is neither.
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
