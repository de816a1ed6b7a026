"""Data sets are read as they are meant, or refused with file, line and what would be right."""

from __future__ import annotations

from pathlib import Path

import pytest

from swarmctl.datasets.reading import (
    Epoch,
    Measurement,
    read_epochs,
    read_receivers,
    read_truth,
)
from swarmctl.errors import UsageError

STILL = "receiver,east_m,north_m,up_m\nA,0,0,0\nB,10,0,1\nC,0,10,2\n"
MEASURED = "time_s,receiver_i,receiver_j,rd_m\n"
MOVING = "receiver,time_s,east_m,north_m,up_m\nA,0,0,0,0\nB,0,10,0,0\nA,2,4,0,2\nB,2,10,6,0\n"


def file(directory: Path, content: str | bytes) -> Path:
    path = directory / "some.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


# --- What is read ------------------------------------------------------------------------


def test_lines_of_one_time_make_an_epoch(tmp_path: Path) -> None:
    receivers = read_receivers(file(tmp_path, STILL))
    text = (
        "\ufeffrd_m, time_s,receiver_j,receiver_i,ignored\r\n"
        "1.5,0.1,B,A,x\r\n-2,0.1,C,B,\r\n\r\n3,0.2,A,C,\r\n"
    )
    assert list(read_epochs(file(tmp_path, text), receivers, 0.3)) == [
        Epoch(0.1, (Measurement(0, 1, 1.5, 0.3), Measurement(1, 2, -2.0, 0.3))),
        Epoch(0.2, (Measurement(2, 0, 3.0, 0.3),)),
    ]


def test_times_may_be_those_of_the_unix_epoch(tmp_path: Path) -> None:
    receivers = read_receivers(file(tmp_path, STILL))
    text = MEASURED + "1.7e9,A,B,1\n1700000000.005,A,B,1\n"
    first, second = read_epochs(file(tmp_path, text), receivers, 0.3)
    assert second.epoch_s - first.epoch_s == pytest.approx(0.005, abs=1e-6)


def test_a_row_may_bring_its_own_sigma(tmp_path: Path) -> None:
    receivers = read_receivers(file(tmp_path, STILL))
    text = "time_s,receiver_i,receiver_j,rd_m,sigma_m\n0,A,B,1,0.7\n"
    (epoch,) = read_epochs(file(tmp_path, text), receivers, 0.3)
    assert epoch.measurements[0].sigma_m == 0.7


def test_receivers_that_move_are_where_the_straight_line_is(tmp_path: Path) -> None:
    receivers = read_receivers(file(tmp_path, MOVING))
    a, b = receivers.trajectories
    assert a.at(0.5) == pytest.approx([1.0, 0.0, 0.5])
    assert b.at(0.5) == pytest.approx([10.0, 1.5, 0.0])


@pytest.mark.parametrize("time_s", [-0.1, 2.1])
def test_nobody_knows_where_a_receiver_was_outside_its_times(tmp_path: Path, time_s: float) -> None:
    (a, _) = read_receivers(file(tmp_path, MOVING)).trajectories
    assert a.at(time_s) is None


# --- What is refused ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("", "line 1: the file is empty; a header time_s,receiver_i,receiver_j,rd_m[,sigma_m]"),
        (MEASURED, "line 2: there are no lines below the header"),
        ("time_s,receiver_i,rd_m\n0,A,1\n", "line 1: the column is missing: receiver_j; the head"),
        ("time_s,rd_m,rd_m,receiver_i,receiver_j\n", "line 1: the column rd_m is there twice"),
        (MEASURED + "0,A,B,1\n0.2,A,B,1\n\n0.1,A,B,1\n", "line 5: time_s is 0.1 after 0.2; lines"),
        (MEASURED + "0,A,B,1\n0,A,C,1\n0,B,A,1\n", "line 4: the pair of receivers 'B' and 'A' at"),
        (MEASURED + "0,A,D,1\n", "line 2: receiver_j 'D' is not among the receivers; there are A,"),
        (MEASURED + "0,A,,1\n", "line 2: receiver_j is empty"),
        (MEASURED + "0,A,A,1\n", "line 2: receiver_i and receiver_j are both 'A'"),
        (MEASURED + "0,A,B,1\n1,A,B,far\n", "line 3: rd_m is 'far'; a finite number would be righ"),
        (MEASURED + "0,A,B,nan\n", "line 2: rd_m is 'nan'; a finite number"),
        (MEASURED + "0,A,B,-1e200\n", "line 2: rd_m is -1e200; at most 1e+09 would be right."),
        (MEASURED + "1.7e12,A,B,1\n", "line 2: time_s is 1.7e12; at most 1e+11 would be right."),
        (MEASURED + "inf,A,B,1\n", "line 2: time_s is 'inf'; a finite number"),
        (MEASURED + "0,A,B\n", "line 2: it has 3 cells, and the header names 4 columns"),
        (MEASURED[:-1] + ",sigma_m\n0,A,B,1,0\n", "line 2: sigma_m is 0; a number above 0"),
        (MEASURED + '0,A,B,"1\n', "this is no CSV"),
        (b"\xff\xfe\x00", "is no text in UTF-8"),
    ],
)
def test_measurements_that_are_wrong_are_refused(
    tmp_path: Path, content: str | bytes, sentence: str
) -> None:
    receivers = read_receivers(file(tmp_path, STILL))
    path = file(tmp_path, content)
    with pytest.raises(UsageError) as caught:
        list(read_epochs(path, receivers, 0.3))
    assert str(caught.value).startswith(str(path))
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("receiver,east_m\nA,0\n", "line 1: the columns are missing: north_m, up_m"),
        (STILL + "A,1,1,1\n", "line 5: receiver 'A' is there twice; one line each, or a column"),
        (MOVING + "B,2,0,0,0\n", "line 6: time_s 2 of receiver 'B' is there twice"),
        (MOVING + "B,1,0,0,0\n", "line 6: time_s of receiver 'B' is 1 after 2; lines sorted"),
        ("receiver,east_m,north_m,up_m\nA,0,0,0\n", "there is one receiver; two or more"),
        (STILL + "D,1,x,1\n", "line 5: north_m is 'x'"),
    ],
)
def test_receivers_that_are_wrong_are_refused(tmp_path: Path, content: str, sentence: str) -> None:
    with pytest.raises(UsageError) as caught:
        read_receivers(file(tmp_path, content))
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("rows", "sentence"),
    [
        ("0,1,1,1\n0,1,1,1\n", "line 3: time_s 0 is there twice"),
        ("1,1,1,1\n0,1,1,1\n", "line 3: time_s is 0 after 1; lines sorted by time"),
    ],
)
def test_a_truth_that_is_wrong_is_refused(tmp_path: Path, rows: str, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        read_truth(file(tmp_path, "time_s,east_m,north_m,up_m\n" + rows))


def test_a_file_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"none\.csv cannot be read: No such file"):
        read_truth(tmp_path / "none.csv")
