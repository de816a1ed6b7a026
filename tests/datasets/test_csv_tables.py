"""CSV files with a header: what is read, and how an error names the file and the line."""

from __future__ import annotations

from pathlib import Path

import pytest

from swarmctl.datasets.csv_tables import Line, lines
from swarmctl.errors import UsageError


def table(directory: Path, content: str | bytes) -> list[Line]:
    path = directory / "some.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return list(lines(path, ("a", "b"), ("c",)))


def test_columns_may_stand_in_any_order_and_others_are_ignored(tmp_path: Path) -> None:
    first, second = table(tmp_path, "\ufeffx,b, a\n1,2,3\n\n ,5,6\n")
    assert (first.number, first.cells) == (2, {"a": "3", "b": "2"})
    assert (second.number, second.cells) == (4, {"a": "6", "b": "5"})


def test_an_optional_column_is_there_if_the_file_has_it(tmp_path: Path) -> None:
    (line,) = table(tmp_path, "a,b,c\n1,2,3\n")
    assert line.cells == {"a": "1", "b": "2", "c": "3"}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "line 1: the file is empty; a header a,b[,c] would be right"),
        ("a,b\n", "line 2: there are no lines below the header"),
        ("a,c\n1,2\n", "line 1: the column is missing: b; the header is 'a,c'"),
        ("a,b,a\n1,2,3\n", "line 1: the column a is there twice"),
        ("a,b\n1,2\n3\n", "line 3: it has 1 cells"),
        ('a,b\n1,"2\n', "this is no CSV"),
        (b"\xff\xfe\x00", "is no text in UTF-8"),
    ],
)
def test_a_file_that_is_wrong_is_refused(
    tmp_path: Path, content: str | bytes, message: str
) -> None:
    with pytest.raises(UsageError) as refusal:
        table(tmp_path, content)
    assert str(tmp_path / "some.csv") in str(refusal.value)
    assert message in str(refusal.value)


def cell(text: str) -> Line:
    return Line(Path("some.csv"), 7, {"a": text})


def test_a_number_is_read() -> None:
    assert cell("1.5e3").number_in("a") == 1500.0
    assert cell("-2").number_in("a", largest=2.0) == -2.0


@pytest.mark.parametrize(
    ("text", "positive", "message"),
    [
        ("x", False, "a is 'x'; a finite number would be right."),
        ("nan", False, "a is 'nan'; a finite number would be right."),
        ("inf", False, "a is 'inf'; a finite number would be right."),
        ("-11", False, "a is -11; at most 10 would be right."),
        ("0", True, "a is 0; a number above 0 would be right."),
    ],
)
def test_a_number_that_is_wrong_is_refused(text: str, positive: bool, message: str) -> None:
    with pytest.raises(UsageError) as refusal:
        cell(text).number_in("a", positive=positive, largest=10.0)
    assert str(refusal.value) == f"some.csv, line 7: {message}"


def test_an_empty_name_is_refused() -> None:
    assert cell("mast").name_in("a") == "mast"
    with pytest.raises(UsageError, match="a is empty"):
        cell("").name_in("a")
