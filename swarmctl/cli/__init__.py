"""The command line: ``swarmctl demo``, ``sim``, ``run``."""

from swarmctl.cli.app import main

__all__ = ["main"]
