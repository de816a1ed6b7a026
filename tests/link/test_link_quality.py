"""Losses by sequence number."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmctl.link.link_quality import LinkStatistics
from swarmctl.link.vehicle_clock import BootClock, RoundTrips


def counted(*sequence_numbers: int) -> LinkStatistics:
    statistics = LinkStatistics(0.0)
    for seq in sequence_numbers:
        statistics.count(seq)
    return statistics


def test_an_unbroken_sequence_has_no_loss_across_the_wrap() -> None:
    statistics = counted(*(seq % 256 for seq in range(200, 800)))
    assert (statistics.messages_in, statistics.lost) == (600, 0)


@pytest.mark.parametrize(
    ("sequence_numbers", "lost"),
    [
        ((7, 9), 1),
        ((254, 1), 2),
        ((0, 128), 127),
        ((0, 129), 0),
        ((5, 7, 6, 8), 0),
        ((255, 1, 0, 2), 0),
        ((5, 8, 6, 9), 1),
        ((5, 6, 6, 6, 7), 0),
        ((5, 7, 7, 8, 7), 1),
        ((5, 7, 6, 6), 0),
    ],
    ids=str,
)
def test_gaps_late_and_repeated_messages(sequence_numbers: tuple[int, ...], lost: int) -> None:
    assert counted(*sequence_numbers).lost == lost


def test_a_message_before_the_first_one_heard_is_not_a_negative_loss() -> None:
    assert counted(5, 4, 3).lost == 0


@pytest.mark.parametrize(("behind", "lost"), [(63, 0), (64, 1)])
def test_a_message_counts_as_late_up_to_63_behind(behind: int, lost: int) -> None:
    assert counted(99, *range(101, 101 + behind), 100).lost == lost


def test_a_restarted_sender_has_lost_nothing() -> None:
    assert counted(199, 200, 100, 101, 102).lost == 0
    assert counted(*range(100), 0, 1, 2, 3).lost == 0


@given(
    first=st.integers(0, 255),
    dropped=st.sets(st.integers(1, 199), max_size=60),
    delays=st.lists(st.integers(0, 30), min_size=200, max_size=200),
    repeats=st.sets(st.integers(1, 199), max_size=20),
)
def test_agrees_with_bookkeeping_of_the_true_numbers(
    first: int, dropped: set[int], delays: list[int], repeats: set[int]
) -> None:
    kept = [n for n in range(200) if n not in dropped]
    arrivals = sorted(
        [(n + (delays[n] if n else 0), n) for n in kept]
        + [(n + 31, n) for n in repeats & set(kept)]
    )
    newest = max(kept)
    statistics = counted(*((first + n) % 256 for _, n in arrivals))
    assert statistics.messages_in == len(arrivals)
    assert statistics.lost == len([n for n in dropped if n < newest])


def test_report_gives_totals_and_the_rate_since_the_last_report() -> None:
    statistics = LinkStatistics(10.0)
    for seq in (0, 1, 2, 4):
        statistics.count(seq)
    report = statistics.report(3, 12.0, BootClock(), RoundTrips())
    assert (report.sysid, report.received_s) == (3, 12.0)
    assert (report.messages_in, report.lost, report.rate_hz) == (4, 1, 2.0)
    statistics.count(5)
    assert statistics.report(3, 12.5, BootClock(), RoundTrips()).rate_hz == 2.0
    assert statistics.report(3, 13.0, BootClock(), RoundTrips()).rate_hz == 0.0
    assert statistics.report(3, 13.0, BootClock(), RoundTrips()).rate_hz == 0.0
