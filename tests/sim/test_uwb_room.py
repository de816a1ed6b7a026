"""The recording of a room that comes with the tests."""

from __future__ import annotations

from pathlib import Path

from sim import uwb_room as room

SHIPPED = Path(__file__).parents[1] / "recordings" / "room"


def test_the_shipped_recording_is_what_the_generator_makes() -> None:
    made = room.record(0, 20.0)
    for name, content in made._asdict().items():
        assert (SHIPPED / f"{name}.csv").read_text(encoding="utf-8") == content


def test_the_emitter_rests_on_the_floor_and_stays_in_the_room() -> None:
    assert room.emitter(0.0) == room.emitter(1.0) == (3.5, 4.0, 0.1)
    for k in range(2000):
        assert all(
            0.0 < x < size for x, size in zip(room.emitter(0.1 * k), room.SIZE_M, strict=True)
        )
