"""The vehicle link that a mission wants."""

from __future__ import annotations

import subprocess
import sys

import pytest

from swarmctl.errors import UsageError
from swarmctl.link.address import Address
from swarmctl.ops.vehicle_links import station_addresses


def test_a_native_flight_does_not_load_mavsdk() -> None:
    code = "import sys, swarmctl.ops.live; assert not {'mavsdk', 'sim'} & sys.modules.keys()"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_other_stations_are_numbered_after_the_links() -> None:
    urls = ["udpout://10.0.0.1:14551", "udpout://10.0.0.2:14552"]
    assert station_addresses(urls, first=3) == [
        Address("10.0.0.1", 14551, 3),
        Address("10.0.0.2", 14552, 4),
    ]


@pytest.mark.parametrize("url", ["http://10.0.0.1", "udpin://0.0.0.0:14551", "tcp://10.0.0.1:5760"])
def test_only_udpout_can_be_forwarded_to(url: str) -> None:
    with pytest.raises(UsageError, match="udpout://host:port"):
        station_addresses([url], 1)
