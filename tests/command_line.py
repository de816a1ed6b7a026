"""The command line run in the test's own process: no interpreter to start, the same ``main``."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from pathlib import Path
from subprocess import CompletedProcess
from unittest.mock import patch

from swarmctl.cli import main

COLUMNS = "100"


def run(*arguments: str, cwd: Path) -> CompletedProcess[str]:
    """Run ``swarmctl ARGUMENTS`` in a directory; an exception that escapes is the test's failure.

    Args:
        *arguments: As on the command line, the command first.
        cwd: The working directory.
    """
    output, errors = io.BytesIO(), io.BytesIO()
    # Text with the bytes below it, as a terminal's or a pipe's.
    standard_output = io.TextIOWrapper(output, "utf-8", write_through=True)
    standard_error = io.TextIOWrapper(errors, "utf-8", write_through=True)
    code = 0
    with (
        contextlib.chdir(cwd),
        contextlib.redirect_stdout(standard_output),
        contextlib.redirect_stderr(standard_error),
        patch.object(sys, "argv", ["swarmctl", *arguments]),
        patch.object(sys, "path", [*sys.path]),  # a study's files add their folder
        # The machine's, not the test runner's: numbers are wanted in full.
        patch.dict(os.environ, {"COLUMNS": COLUMNS}),
    ):
        try:
            main()
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    return CompletedProcess(arguments, code, output.getvalue().decode(), errors.getvalue().decode())
