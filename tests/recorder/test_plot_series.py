"""Time series thinned to bounded memory."""

from __future__ import annotations

import itertools

from swarmctl.recorder.plot_series import Extremes, Series


def test_rows_keep_their_distance() -> None:
    series = Series(interval_s=0.5)
    for k in range(21):
        series.add((0.1 * k, float(k)))
    assert [row[1] for row in series.rows] == [0.0, 5.0, 10.0, 15.0, 20.0]


def test_at_the_limit_the_whole_flight_stays_covered() -> None:
    series = Series(interval_s=1.0, limit=100)
    for k in range(100_000):
        series.add((float(k), 0.0))
        assert len(series.rows) < 100
    times = [row[0] for row in series.rows]
    steps = [b - a for a, b in itertools.pairwise(times)]
    assert times[0] == 0.0
    assert len(times) >= 48
    assert set(steps) == {1024.0 if len(times) > 50 else 2048.0}
    assert times[-1] + steps[-1] >= 100_000


def test_extremes_miss_nothing_between_rows() -> None:
    greatest, least = Extremes(max), Extremes(min)
    values = [5.0, 1.0, 9.0, 2.0, 3.0, 4.0, 0.0, 6.0, 7.0]
    for k, value in enumerate(values):
        greatest.add(0.5 * k, value)
        least.add(0.5 * k, value)
    # Rows every 2 s: the first value, then what came in the half-open interval after a row.
    assert greatest.rows == [(0.0, 5.0), (2.0, 9.0), (4.0, 7.0)]
    assert least.rows == [(0.0, 5.0), (2.0, 1.0), (4.0, 0.0)]
