"""The plot of the receivers: what was estimated and what was true, in the right axes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import msgspec
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from swarmctl.decisions import PhaseChanged, ReceiverEstimate
from swarmctl.events import ReceiverTruth, Record
from swarmctl.recorder.debrief import Debrief
from swarmctl.recorder.plots import write_plots
from swarmctl.recorder.receiver_plot import draw_receivers
from tests.recorder import flight as made_up
from tests.recorder import receivers
from tests.recorder.receivers import clock, navigation


def debrief(records: Iterable[Record]) -> Debrief:
    it = Debrief(made_up.SETTINGS)
    for record in records:
        it.record(record)
    return it


def drawn(records: Iterable[Record]) -> Figure:
    figure = draw_receivers(debrief(records))
    assert figure is not None
    return figure


def track(relative_to: Callable[[float], int] = lambda _t: 1) -> list[Record]:
    """Truths and estimates that are the truth."""
    out: list[Record] = []
    for t in range(100, 200):
        for sysid in receivers.RECEIVERS:
            out.append(receivers.truth(sysid, float(t)))
            other = relative_to(float(t))
            out.append(receivers.estimate(sysid, float(t), relative_to=other))
    return out


def curve(axes: Axes, label: str) -> NDArray[np.float64]:
    """Times and values of a labelled line, (2, points)."""
    (line,) = [line for line in axes.get_lines() if line.get_label() == label]
    return np.array([line.get_xdata(), line.get_ydata()], dtype=float)


def panels(figure: Figure) -> dict[str, list[Axes]]:
    """The panels of each row, by the row's name."""
    names = [str(axes.get_ylabel()) for axes in figure.axes]
    columns = len([axes for axes in figure.axes if axes.get_title(loc="left")])
    return {names[k]: figure.axes[k : k + columns] for k in range(0, len(figure.axes), columns)}


def test_each_receiver_has_its_clock_and_its_navigation_against_the_reference() -> None:
    found = panels(drawn(track()))
    assert list(found) == ["UAV 2", "UAV 3", "UAV 4"]
    for sysid in (2, 3, 4):
        clocks, east, north = found[f"UAV {sysid}"]
        for k, axes in enumerate((clocks, east, north)):
            time, value = curve(axes, "estimate")
            assert np.allclose(curve(axes, "truth"), [time, value], atol=1e-6)
            epochs = np.arange(100.0, 200.0)
            expected = [
                clock(sysid, t) - clock(1, t)
                if k == 0
                else navigation(sysid, t)[k - 1] - navigation(1, t)[k - 1]
                for t in epochs
            ]
            assert np.allclose(value, expected, atol=1e-9)


def test_the_band_is_two_sigma_wide() -> None:
    def sigmas(t: float) -> tuple[float, float, float]:
        told = receivers.estimate(3, t)
        east, north, _ = told.navigation_sigma_enu
        return told.clock_sigma_m, east, north

    for k, axes in enumerate(panels(drawn(track()))["UAV 3"]):
        (band,) = axes.collections
        outline = np.asarray(band.get_paths()[0].vertices)
        time, value = curve(axes, "estimate")
        for i in (0, 50, 99):
            at = outline[np.isclose(outline[:, 0], time[i]), 1]
            assert at.max() == pytest.approx(value[i] + 2.0 * sigmas(100.0 + i)[k])
            assert at.min() == pytest.approx(value[i] - 2.0 * sigmas(100.0 + i)[k])


def test_the_phases_that_are_in_sight_are_named_above_their_time() -> None:
    phases: list[Record] = [
        PhaseChanged(at_s=at_s, phase=name, trigger="-", reason="-")
        for at_s, name in ((0.0, "forming"), (90.0, "approaching"), (150.0, "orbiting"))
    ]
    end = PhaseChanged(at_s=250.0, phase="returning", trigger="-", reason="-")
    figure = drawn([*phases[:2], *track()[:200], phases[2], *track()[200:], end])
    for top in figure.axes[:3]:
        named = {
            text.get_text(): text.get_position()[0]
            for text in top.texts
            if text.get_text() in {"forming", "approaching", "orbiting", "returning"}
        }
        # From 100.2 to 199.2 s: each in the middle of its part of that.
        assert named == {
            "approaching": pytest.approx((150.0 - 100.2) / 99.0 / 2.0),
            "orbiting": pytest.approx((150.0 - 100.2 + 99.0) / 99.0 / 2.0),
        }


def test_another_reference_breaks_the_lines_and_is_compared_with_from_then_on() -> None:
    figure = drawn(track(lambda t: 1 if t < 150.0 else 2))
    assert figure.get_suptitle() == "Errors of the receivers relative to the reference UAV"
    found = panels(figure)
    # The one that led has a row from the change on, and the one that leads now until then.
    assert list(found) == ["UAV 1", "UAV 2", "UAV 3", "UAV 4"]
    for name in found:
        for axes in found[name]:
            assert np.allclose(
                curve(axes, "truth"), curve(axes, "estimate"), atol=1e-6, equal_nan=True
            )
    values = curve(found["UAV 3"][0], "estimate")[1]
    assert np.flatnonzero(np.isnan(values)).tolist() == [50]
    assert values[51] == pytest.approx(clock(3, 150.0) - clock(2, 150.0))
    assert not np.isnan(curve(found["UAV 2"][0], "estimate")).any()


def test_a_kind_of_error_that_is_neither_estimated_nor_there_has_no_panels() -> None:
    nothing = (0.0, 0.0, 0.0)

    def clocks_only(record: Record) -> Record:
        if isinstance(record, ReceiverTruth):
            return msgspec.structs.replace(record, navigation_enu=nothing)
        assert isinstance(record, ReceiverEstimate)
        return msgspec.structs.replace(record, navigation_enu=nothing, navigation_sigma_enu=nothing)

    figure = drawn(map(clocks_only, track()))
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == ["Clock (m; 1 m is 3.3 ns)", "", ""]
    # One that was there and is not estimated is shown: it is the reader's first suspect.
    unmodelled = [r if isinstance(r, ReceiverTruth) else clocks_only(r) for r in track()]
    assert len(drawn(unmodelled).axes) == 9


def test_without_truth_the_estimates_are_drawn_alone() -> None:
    figure = drawn(r for r in track() if not isinstance(r, ReceiverTruth))
    for axes in figure.axes:
        assert {"estimate"} == {
            str(line.get_label())
            for line in axes.get_lines()
            if not str(line.get_label()).startswith("_")
        }
        assert "truth" not in axes.texts[-1].get_text()


def test_the_last_values_are_written_out() -> None:
    axes = panels(drawn(track()))["UAV 4"][0]
    last = clock(4, 199.0) - clock(1, 199.0)
    sigma = receivers.estimate(4, 199.0).clock_sigma_m
    words = [text.get_text() for text in axes.texts]
    assert f"at last {last:.1f} ± {sigma:.1f} m, truth {last:.1f} m" in words


def test_first_wide_bands_do_not_hide_what_comes_later() -> None:
    clocks, *_ = panels(drawn(receivers.records()))["UAV 2"]
    low, high = clocks.get_ylim()
    # The band begins 18 m wide and ends 2 m wide, about lines that span 14 m.
    assert high - low < 18.0
    for label in ("estimate", "truth"):
        values = curve(clocks, label)[1]
        assert low < values.min()
        assert values.max() < high


def test_the_plot_is_written_with_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("swarmctl.recorder.plots._DPI", 30)
    names = {path.name for path in write_plots(debrief(track()), tmp_path)}
    assert "receivers.png" in names
    assert (tmp_path / "receivers.png").stat().st_size > 1000


def test_a_single_estimate_is_drawn_too() -> None:
    assert draw_receivers(debrief([receivers.estimate(2, 100.0)])) is not None
    assert draw_receivers(debrief([receivers.estimate(1, 100.0)])) is None
    assert draw_receivers(debrief([])) is None
