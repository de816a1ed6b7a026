"""Changes critical modules one place at a time and counts the changes that their tests notice.

``python -m tests.mutants [MODULE ...] [--sample N] [--seed S]`` works in a copy of the tree. It
prints the mutants that survive and, per module, how many mutants were made and killed. The exit
code is 1 if the tests of a module kill less than 80 % of its mutants.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from cosmic_ray.commands import init
from cosmic_ray.mutating import mutate_and_test, mutate_code
from cosmic_ray.plugins import get_operator
from cosmic_ray.work_db import WorkDB
from cosmic_ray.work_item import MutationSpec, WorkResult

from tests.mutants.operators import OPERATORS

ROOT = Path(__file__).parents[2]
LEAST_SHARE = 0.8
SHORTEST_TIMEOUT_S = 30.0
PYTEST = (
    f"{shlex.quote(sys.executable)} -m pytest -x -q -m 'not slow' --hypothesis-seed=0"
    " -p no:cacheprovider -p no:xdist -p no:cov"
)


class Target(NamedTuple):
    """Files to change, and the tests that should notice: their mirror and the nearest ones."""

    files: tuple[str, ...]
    tests: tuple[str, ...]


_RULES = "swarmctl/mission/failsafes"
TARGETS = {
    "custody": Target(("swarmctl/mission/custody.py",), ("tests/mission/test_custody.py",)),
    "separation": Target(
        ("swarmctl/formation/separation.py",), ("tests/formation/test_separation.py",)
    ),
    "failsafes": Target(
        tuple(f"{_RULES}/{name}.py" for name in ("judge", "rules", "ardupilot", "px4")),
        ("tests/mission/failsafes/test_judge.py",),
    ),
    "ncrkf": Target(
        ("swarmctl/estimation/kernels/ncrkf.py",), ("tests/estimation/kernels/test_ncrkf.py",)
    ),
    "track": Target(
        ("swarmctl/estimation/track/track.py",),
        ("tests/estimation/track/test_track.py", "tests/estimation/track/test_ncrkf_kernel.py"),
    ),
}


class Tally(NamedTuple):
    """What became of a module's mutants."""

    mutants: int
    killed: int

    @property
    def share(self) -> float:
        """Share of the mutants that were killed."""
        return self.killed / self.mutants


def main() -> int:
    """Run the mutants of the modules named on the command line, or of all."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("modules", nargs="*", metavar="MODULE", help=", ".join(TARGETS))
    parser.add_argument("--sample", type=int, default=40, help="most mutants of a module")
    parser.add_argument("--seed", type=int, default=1, help="seed of the sample")
    args = parser.parse_args()
    if unknown := set(args.modules) - set(TARGETS):
        parser.error(f"no module {', '.join(sorted(unknown))}; there are {', '.join(TARGETS)}")
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        _copy_tree(Path(folder))
        os.chdir(folder)
        names = args.modules or list(TARGETS)
        tallies = {name: _run(name, args.sample, args.seed) for name in names}
        os.chdir(ROOT)
    print(f"{'module':<12}{'mutants':>8}{'killed':>8}{'survived':>10}{'share':>8}")
    for name, tally in tallies.items():
        survived = tally.mutants - tally.killed
        print(f"{name:<12}{tally.mutants:8}{tally.killed:8}{survived:10}{tally.share:8.0%}")
    return int(any(tally.share < LEAST_SHARE for tally in tallies.values()))


def _copy_tree(to: Path) -> None:
    """Copy what git tracks, and what it would track, for nobody to see a mutant in the tree."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    for name in listed.stdout.split("\0"):
        if name and (ROOT / name).is_file():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, to / name)


def _run(name: str, sample: int, seed: int) -> Tally:
    target = TARGETS[name]
    command = f"{PYTEST} {' '.join(target.tests)}"
    began = time.monotonic()
    if subprocess.run(shlex.split(command), check=False, stdout=subprocess.DEVNULL).returncode:
        raise SystemExit(f"{name}: the tests fail without a mutant: {command}")
    timeout_s = max(SHORTEST_TIMEOUT_S, 3.0 * (time.monotonic() - began))
    mutants = _mutants(target)
    if sample < len(mutants):
        mutants = random.Random(seed).sample(mutants, sample)
    print(f"{name}: {len(mutants)} mutants", flush=True)
    killed = 0
    for mutant in sorted(mutants, key=_place):
        result = mutate_and_test([mutant], command, timeout_s)
        if result.is_killed:
            killed += 1
        else:
            print(_told(mutant, result), flush=True)
    return Tally(len(mutants), killed)


def _mutants(target: Target) -> list[MutationSpec]:
    """All mutants by the operators in use that compile and change what runs."""
    found = []
    session = WorkDB("mutants.sqlite", WorkDB.Mode.create)
    init([Path(file) for file in target.files], session, {})
    for item in session.work_items:
        (mutant,) = item.mutations
        if mutant.operator_name in OPERATORS and _is_code(mutant):
            found.append(mutant)
    session.close()
    return sorted(found, key=_place)


def _is_code(mutant: MutationSpec) -> bool:
    source = mutant.module_path.read_text(encoding="utf-8")
    if any(start <= mutant.start_pos < end for start, end in _for_mypy(source)):
        return False
    row, column = mutant.end_pos
    rest = source.splitlines()[row - 1][column:]
    if "BinaryOperator" in mutant.operator_name and rest.startswith(","):
        return False  # f(*, name) is no product
    changed = mutate_code(source, get_operator(mutant.operator_name)(), mutant.occurrence)
    try:
        compile(changed, str(mutant.module_path), "exec")
    except SyntaxError:
        return False
    return True


def _for_mypy(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Where annotations and decorators begin and end: mypy looks after a frozen dataclass."""
    spans = []
    for node in ast.walk(ast.parse(source)):
        parts = [getattr(node, "annotation", None), getattr(node, "returns", None)]
        for part in parts + getattr(node, "decorator_list", []):
            if isinstance(part, ast.expr):
                end = (part.end_lineno or 0, part.end_col_offset or 0)
                spans.append(((part.lineno, part.col_offset), end))
    return spans


def _place(mutant: MutationSpec) -> tuple[str, tuple[int, int], str, int]:
    return str(mutant.module_path), mutant.start_pos, mutant.operator_name, mutant.occurrence


def _told(mutant: MutationSpec, result: WorkResult) -> str:
    lines = (result.diff or "").splitlines()
    changed = [f"    {x}" for x in lines if x[:1] in {"-", "+"} and x[:3] not in {"---", "+++"}]
    return "\n".join([f"  survived {mutant.module_path}:{mutant.start_pos[0]}", *changed])


if __name__ == "__main__":
    sys.exit(main())
