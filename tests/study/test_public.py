"""The names that ``swarmctl.study`` offers, and what it says of its modules."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import swarmctl.study


@pytest.mark.parametrize("name", swarmctl.study.__all__)
def test_a_public_name_is_what_its_module_calls_so(name: str) -> None:
    assert getattr(swarmctl.study, name).__name__ == name
    assert name in dir(swarmctl.study)


def test_another_name_is_refused() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        getattr(swarmctl.study, "nothing")  # noqa: B009 - mypy knows that it is not there


def test_the_package_itself_loads_nothing() -> None:
    code = "import sys, swarmctl.study; print({'numpy', 'scipy', 'sim'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_its_docstring_names_every_module_and_no_other() -> None:
    modules = {path.stem for path in Path(swarmctl.study.__file__).parent.glob("*.py")}
    named = set(re.findall(r"``(\w+)`` ", swarmctl.study.__doc__ or ""))
    assert named == modules - {"__init__"}
