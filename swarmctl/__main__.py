"""``python -m swarmctl``: the command line."""

from swarmctl.cli import main

main()
