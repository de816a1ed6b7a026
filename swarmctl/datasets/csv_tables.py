"""CSV files with a header; an error names the file and the line."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from swarmctl.errors import UsageError


@dataclass(frozen=True, slots=True)
class Line:
    """One line of a table.

    Attributes:
        path: The file.
        number: Number of the line; the header is line 1.
        cells: Text by column.
    """

    path: Path
    number: int
    cells: dict[str, str]

    def error(self, text: str) -> UsageError:
        """The exception to raise if something is wrong with this line."""
        return UsageError(f"{self.path}, line {self.number}: {text}")

    def number_in(self, column: str, *, positive: bool = False, largest: float = math.inf) -> float:
        """Read a finite number.

        Args:
            column: Column of the cell.
            positive: Whether it must be above 0.
            largest: Limit of its absolute value.

        Raises:
            UsageError: The cell is no finite number, or not within the limits.
        """
        text = self.cells[column]
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self.error(f"{column} is {text!r}; a finite number would be right.")
        if abs(value) > largest:
            raise self.error(f"{column} is {text}; at most {largest:g} would be right.")
        if positive and value <= 0.0:
            raise self.error(f"{column} is {text}; a number above 0 would be right.")
        return value

    def name_in(self, column: str) -> str:
        """Read a text that is not empty.

        Raises:
            UsageError: The cell is empty.
        """
        text = self.cells[column]
        if not text:
            raise self.error(f"{column} is empty; the name of a receiver would be right.")
        return text


def lines(path: Path, required: Sequence[str], optional: Sequence[str] = ()) -> Iterator[Line]:
    """Read the lines of a table, one after the other; empty lines are skipped.

    Args:
        path: The file, UTF-8. Its first line names the columns, in any order; columns that are
            neither required nor optional are ignored.
        required: Columns that must be there.
        optional: Columns that may be there.

    Raises:
        UsageError: The file cannot be read, is not CSV, lacks a column or a cell, or has no
            lines below the header.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            yield from _lines(path, csv.reader(file, strict=True), required, optional)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError:
        raise UsageError(f"{path} is no text in UTF-8; a CSV file would be right.") from None


def _lines(
    path: Path, reader: Iterator[list[str]], required: Sequence[str], optional: Sequence[str]
) -> Iterator[Line]:
    right = ",".join(required) + "".join(f"[,{name}]" for name in optional)
    number = 0
    places: dict[str, int] | None = None
    empty = True
    while True:
        number = getattr(reader, "line_num", number) + 1
        try:
            cells = [cell.strip() for cell in next(reader)]
        except StopIteration:
            break
        except csv.Error as error:
            raise UsageError(f"{path}, line {number}: this is no CSV: {error}.") from None
        if not any(cells):
            continue
        if places is None:
            places = _places(path, number, cells, required, optional, right)
            continue
        if len(cells) <= max(places.values()):
            raise UsageError(
                f"{path}, line {number}: it has {len(cells)} cells, and the header names"
                f" {max(places.values()) + 1} columns or more; {right} would be right."
            )
        empty = False
        yield Line(path, number, {name: cells[place] for name, place in places.items()})
    if places is None:
        raise UsageError(f"{path}, line 1: the file is empty; a header {right} would be right.")
    if empty:
        raise UsageError(f"{path}, line {number}: there are no lines below the header.")


def _places(
    path: Path,
    number: int,
    header: list[str],
    required: Sequence[str],
    optional: Sequence[str],
    right: str,
) -> dict[str, int]:
    twice = [name for name in (*required, *optional) if header.count(name) > 1]
    if twice:
        raise UsageError(f"{path}, line {number}: the column {twice[0]} is there twice.")
    missing = [name for name in required if name not in header]
    if missing:
        several = "columns are" if len(missing) > 1 else "column is"
        raise UsageError(
            f"{path}, line {number}: the {several} missing: {', '.join(missing)}; the header is"
            f" {','.join(header)!r}, and {right} would be right."
        )
    return {name: header.index(name) for name in (*required, *optional) if name in header}
