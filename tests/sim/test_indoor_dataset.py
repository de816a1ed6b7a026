"""The recording of a room that comes with the tests."""

from __future__ import annotations

from pathlib import Path

from sim import indoor_dataset

SHIPPED = Path(__file__).parents[1] / "datasets" / "room"


def test_the_shipped_recording_is_what_the_generator_makes() -> None:
    made = indoor_dataset.simulate(0, 20.0)
    for name, content in made._asdict().items():
        assert (SHIPPED / f"{name}.csv").read_text(encoding="utf-8") == content


def test_the_emitter_rests_on_the_floor_and_stays_in_the_room() -> None:
    assert indoor_dataset.emitter(0.0) == indoor_dataset.emitter(1.0) == (3.5, 4.0, 0.1)
    for k in range(2000):
        assert all(
            0.0 < x < size
            for x, size in zip(indoor_dataset.emitter(0.1 * k), indoor_dataset.SIZE_M, strict=True)
        )
