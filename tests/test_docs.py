"""The documentation: generated parts are up to date, links and names lead somewhere."""

import ast
import importlib
import re
import runpy
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

import swarmctl

ROOT = Path(__file__).parents[1]
TOP = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
PAGES = [*TOP, *sorted((ROOT / "docs").rglob("*.md"))]
SITE_ONLY = {ROOT / "docs" / name for name in ("index.md", "contributing.md", "changelog.md")}
"""Pages that show those at the top on the site."""
GENERATED: dict[Path, str] = runpy.run_path(str(ROOT / "docs" / "generate.py"))["pages"]()


@pytest.mark.parametrize("path", GENERATED, ids=lambda p: p.stem)
def test_generated_parts_are_up_to_date(path: Path) -> None:
    assert path.read_text() == GENERATED[path], "run `make docs`"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_links_lead_to_files_that_exist(page: Path) -> None:
    links = re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text())
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_every_page_can_be_reached_from_the_readme() -> None:
    reached, waiting = set(), [ROOT / "README.md"]
    while waiting:
        page = waiting.pop().resolve()
        if page in reached or page.suffix != ".md":
            continue
        reached.add(page)
        links = re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text())
        waiting += [page.parent / link for link in links]
    assert set(PAGES) - SITE_ONLY <= reached


def resolve(name: str) -> object:
    """What a dotted name means; raises ImportError or AttributeError if nothing."""
    if "." not in name:
        return importlib.import_module(name)
    home, _, last = name.rpartition(".")
    parent = resolve(home)
    if last in getattr(parent, "__annotations__", {}):
        return None  # a field of a class
    try:
        return getattr(parent, last)
    except AttributeError:
        return importlib.import_module(name)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_names_of_python_exist(page: Path) -> None:
    gone = []
    for name in re.findall(r"`(swarmctl(?:\.\w+)+)(?:\(.*?\))?`", page.read_text()):
        try:
            resolve(name)
        except (ImportError, AttributeError):
            gone.append(name)
    assert gone == []


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_paths_exist(page: Path) -> None:
    paths = re.findall(r"`((?:swarmctl|sim|missions|tests|docs)/[\w./-]*)`", page.read_text())
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_every_word_of_the_vocabulary_has_a_type() -> None:
    page = (ROOT / "docs" / "reference" / "vocabulary.md").read_text()
    rows = [line for line in page.splitlines() if line.startswith("|")]
    rows = [row for row in rows if not row.startswith(("| word |", "|---"))]
    assert len(rows) >= 20
    typed = re.compile(r"\| `(swarmctl(\.\w+)+|float|int)`[^|]*\|$")
    assert [row for row in rows if not typed.search(row)] == []


def test_the_newest_version_of_the_changelog_is_this_one() -> None:
    versions = re.findall(r"^## (\d\S*)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert versions[0] == swarmctl.__version__
    assert f"version: {swarmctl.__version__}\n" in (ROOT / "CITATION.cff").read_text()


RIDDLE = re.compile(r"(?:^|[.!?:]\s+|\A\s*)Of\s", re.MULTILINE)
"""A sentence that begins with "Of" makes its reader wait for what it is about."""


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_no_sentence_of_a_page_begins_with_of(page: Path) -> None:
    assert RIDDLE.findall(page.read_text()) == []


def prose(path: Path) -> Iterator[str]:
    """The docstrings and comments of a source file."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield str(node.value.value)
    with tokenize.open(path) as lines:
        for token in tokenize.generate_tokens(lines.readline):
            if token.type == tokenize.COMMENT:
                yield token.string.lstrip("# ")


def test_no_sentence_of_the_code_begins_with_of() -> None:
    files = [
        path for room in ("swarmctl", "sim", "missions") for path in (ROOT / room).rglob("*.py")
    ]
    found = [
        (path.relative_to(ROOT).as_posix(), text)
        for path in files
        for text in prose(path)
        if RIDDLE.search(text)
    ]
    assert found == []


def test_prose_of_a_file_is_its_docstrings_and_comments(tmp_path: Path) -> None:
    path = tmp_path / "module.py"
    path.write_text('"""Of old."""\nx = "Of text"  # Of note\n')
    assert [RIDDLE.search(text) is not None for text in prose(path)] == [True, True]
