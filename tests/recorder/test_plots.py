"""The plots: drawn for every kind of flight, one colour per vehicle, the right numbers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import Rectangle

from swarmctl.decisions import EstimateMade, Plan
from swarmctl.events import EmitterTruth, Record, VehiclePosition
from swarmctl.recorder import plots
from swarmctl.recorder.debrief import Debrief
from tests.recorder import flight as made_up
from tests.recorder import receivers

NAMES = ("map.png", "error.png", "slots.png", "ranges.png")


def debrief(*left_out: type[Record], count: int | None = None) -> Debrief:
    it = Debrief(made_up.SETTINGS)
    for record in made_up.records()[:count]:
        if not isinstance(record, left_out):
            it.record(record)
    return it


@pytest.fixture(scope="module")
def whole_flight() -> Debrief:
    return debrief()


def is_drawn(path: Path) -> bool:
    """Whether a plot has more to it than its background."""
    pixels = imread(path)
    height, width = pixels.shape[:2]
    drawn = np.any(pixels[..., :3] < 0.9, axis=-1).mean()
    return bool(height > 500 and width > 1000 and 0.01 < drawn < 0.5)


def test_four_plots_are_drawn(whole_flight: Debrief, tmp_path: Path) -> None:
    assert plots.write_plots(whole_flight, tmp_path) == tuple(tmp_path / name for name in NAMES)
    assert all(is_drawn(tmp_path / name) for name in NAMES)


@pytest.mark.parametrize(
    "left_out",
    [(EmitterTruth,), (EmitterTruth, EstimateMade), (Plan,), (VehiclePosition,), (Record,)],
    ids=["no truth", "no estimate", "never formed", "no position", "nothing at all"],
)
def test_a_flight_that_lacks_something_is_drawn_too(
    left_out: tuple[type[Record], ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plots, "_DPI", 30)  # a quarter of the time
    for path in plots.write_plots(debrief(*left_out, count=10_000), tmp_path):
        assert path.stat().st_size > 1000


def lines(axes: Axes) -> dict[str, str]:
    """Colour by label."""
    return {
        str(line.get_label()): str(line.get_color())
        for line in axes.get_lines()
        if not str(line.get_label()).startswith("_")
    }


def test_a_vehicle_has_one_colour_in_all_plots(whole_flight: Debrief) -> None:
    draw: tuple[Callable[[Debrief], Figure], ...] = (plots._map, plots._slots, plots._ranges)
    seen = [lines(function(whole_flight).axes[0]) for function in draw]
    colours = [{label: of[label] for label in ("UAV 2", "UAV 3", "UAV 4")} for of in seen]
    assert colours[0] == colours[1] == colours[2]
    assert len({*colours[0].values(), seen[0]["reference 1"]}) == 4


def test_the_plots_and_the_summary_agree(whole_flight: Debrief) -> None:
    summary = whole_flight.figures()
    close = plots._map(whole_flight).axes[1]
    words = f"1-sigma {summary.final_sigma_m:.1f} m, error {summary.final_error_m:.1f} m"
    assert words in [text.get_text() for text in close.texts]
    (curve,) = plots._ranges(whole_flight).axes[1].get_lines()[-2:-1]
    assert np.min(curve.get_ydata()) == summary.min_standoff_m


def test_the_phases_are_named_and_the_observing_ones_shaded(whole_flight: Debrief) -> None:
    axes = plots._error(whole_flight).axes[0]
    named = {text.get_text() for text in axes.texts}
    assert {"launching", "forming", "approaching", "orbiting", "returning"} <= named
    shaded = [patch.get_window_extent() for patch in axes.patches]
    to_time = axes.transData.inverted()
    spans = [
        (to_time.transform((box.x0, 0.0))[0], to_time.transform((box.x1, 0.0))[0]) for box in shaded
    ]
    assert np.allclose(spans, [(60.0, 190.0), (190.0, 270.0)])


def test_the_error_is_shaded_where_the_track_was_not_to_be_believed() -> None:
    it = Debrief(made_up.SETTINGS)
    for record in receivers.whole_flight():
        it.record(record)
    axes = plots._error(it).axes[0]
    shaded = [
        (str(patch.get_label()), patch.get_x(), patch.get_x() + patch.get_width())
        for patch in axes.patches
        if isinstance(patch, Rectangle)
        and patch.get_facecolor() in {to_rgba(colour) for colour in plots._HEALTH.values()}
    ]
    assert shaded == [
        ("track degraded", 120.0, 140.0),
        ("track diverged", 140.0, 150.0),
        ("_", 200.0, 215.0),
    ]
