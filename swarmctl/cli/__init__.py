"""The command line: ``swarmctl demo``, ``run``, ``sim``, ``design``, ``track`` and ``study``."""

from swarmctl.cli.app import main

__all__ = ["main"]
