"""The estimate as others read it over MQTT."""

from __future__ import annotations

import math

import msgspec
import pytest

from swarmctl.decisions import EstimateMade
from swarmctl.feed.schema import EstimateMessage
from swarmctl.frames import LocalFrame
from swarmctl.ops.estimate_publication import EstimatePublication, estimate_message

FRAME = LocalFrame(0.95, 0.19, 12.0)
SIGMAS = (30.0, 10.0, 2.0, 1.0, 1.0, 1.0)
ESTIMATE = EstimateMade(
    at_s=5.0,
    epoch_utc_s=1000.0,
    position_enu=(400.0, -300.0, 50.0),
    velocity_enu=(1.0, 2.0, 0.0),
    covariance=tuple(
        sigma**2 if row == column else 0.0
        for row, sigma in enumerate(SIGMAS)
        for column in range(6)
    ),
    nis=2.0,
    rd_count=3,
)


def test_it_is_a_place_on_earth_with_its_95_percent_ellipse_and_its_age() -> None:
    message = estimate_message(ESTIMATE, FRAME, 1000.4)
    lat_rad, lon_rad = math.radians(message.lat_deg), math.radians(message.lon_deg)
    there = FRAME.to_enu(lat_rad, lon_rad, message.alt_amsl_m)
    assert there == pytest.approx(ESTIMATE.position_enu, abs=1e-6)
    assert message.position_enu == ESTIMATE.position_enu
    assert message.covariance_enu == (900.0, 0.0, 0.0, 0.0, 100.0, 0.0, 0.0, 0.0, 4.0)
    # 95 % of a plane normal distribution lie within sqrt(-2 ln 0.05) = 2.448 sigma.
    scale = math.sqrt(-2.0 * math.log(0.05))
    major_m, minor_m, angle_rad = message.ellipse_95
    assert (major_m, minor_m) == pytest.approx((scale * 30.0, scale * 10.0), rel=1e-6)
    assert math.sin(angle_rad) == pytest.approx(0.0, abs=1e-9)  # the long axis points east
    assert message.age_s == pytest.approx(0.4)


@pytest.mark.parametrize("utc_s", [None, 999.0], ids=["UTC unknown", "UTC behind"])
def test_an_age_is_never_negative_or_unknown(utc_s: float | None) -> None:
    assert estimate_message(ESTIMATE, FRAME, utc_s).age_s == 0.0


def test_it_is_published_twice_a_second_at_most() -> None:
    publication = EstimatePublication("alpha", FRAME, 10.0)
    published = []
    for now in (10.0, 10.1, 10.49, 10.5, 10.9, 11.0):
        publication.offer(ESTIMATE, 1000.0, now)
        published += [(now, topic, payload) for topic, payload in publication.drain()]
    assert [now for now, _, _ in published] == [10.0, 10.5, 11.0]
    assert {topic for _, topic, _ in published} == {"swarm/alpha/estimate"}
    sent = msgspec.json.decode(published[0][2], type=EstimateMessage)
    assert sent == estimate_message(ESTIMATE, FRAME, 1000.0)
