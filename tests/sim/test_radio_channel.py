"""The radio channel: what it does to datagrams is what it is told to do."""

from __future__ import annotations

import numpy as np
import pytest

from sim.noise import generator
from sim.radio_channel import Impairments, RadioChannel
from swarmctl.errors import SimulationError

COUNT = 20_000


def passed(
    impairments: Impairments, count: int = COUNT, every_s: float = 0.1
) -> list[tuple[float, int]]:
    """Numbers sent one after the other, with the step at which each came out."""
    channel: RadioChannel[int] = RadioChannel(impairments, generator(1, "test"))
    out = []
    for i in range(count + 20):
        now_s = i * every_s
        if i < count:
            channel.send(i, now_s)
        out += [(now_s, item) for item in channel.receive(now_s)]
    return out


def test_a_perfect_channel_delivers_everything_at_once_in_order() -> None:
    assert passed(Impairments(), 50) == [(i * 0.1, i) for i in range(50)]


def test_loss_and_duplication_have_their_probabilities() -> None:
    out = passed(Impairments(loss=0.2, duplication=0.1))
    _, copies = np.unique([item for _, item in out], return_counts=True)
    # Five standard deviations of a binomial count, in shares.
    assert len(copies) / COUNT == pytest.approx(0.8, abs=5 * (0.8 * 0.2 / COUNT) ** 0.5)
    kept = 0.8 * COUNT
    assert np.mean(copies == 2) == pytest.approx(0.1, abs=5 * (0.1 * 0.9 / kept) ** 0.5)
    assert copies.max() == 2


def test_delay_lies_between_its_bounds_and_jitter_lets_some_overtake() -> None:
    out = passed(Impairments(delay_s=0.3, jitter_s=0.25), 2000, every_s=0.01)
    delays = np.array([now_s - item * 0.01 for now_s, item in out])
    assert delays.min() >= 0.3 - 1e-9
    assert delays.max() <= 0.55 + 0.01
    items = [item for _, item in out]
    assert items != sorted(items)
    steady = passed(Impairments(delay_s=0.3), 200, every_s=0.01)
    assert [item for _, item in steady] == sorted(item for _, item in steady)


@pytest.mark.parametrize(
    "impossible", [Impairments(loss=1.1), Impairments(duplication=-0.1), Impairments(delay_s=-1.0)]
)
def test_an_impossible_channel_is_refused(impossible: Impairments) -> None:
    with pytest.raises(SimulationError, match="are probabilities"):
        RadioChannel(impossible, generator(1, "test"))
