"""The vehicle link that a mission wants: our own MAVLink or MAVSDK (``swarm.backend``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from swarmctl.errors import UsageError
from swarmctl.link.address import Address
from swarmctl.link.endpoints.url import parse_url
from swarmctl.link.mavlink_link import MavlinkLink
from swarmctl.link.signing import Signing
from swarmctl.mission.mission_file import Mission

if TYPE_CHECKING:
    from swarmctl.link.mavsdk_link import MavsdkLink


def native_link(
    mission: Mission,
    *,
    signing: Signing | None = None,
    stations: Sequence[Address] = (),
    speedup: float = 1.0,
) -> MavlinkLink:
    """A link that speaks MAVLink itself; the caller moves its datagrams.

    Args:
        mission: The mission.
        signing: Signs MAVLink, and refuses what is not signed; None without a key.
        stations: Addresses of other ground stations that MAVLink is passed on to.
        speedup: Seconds of mission time per second.
    """
    return MavlinkLink(
        gcs_sysid=mission.swarm.gcs_sysid,
        vehicles=mission.swarm.sysids,
        signing=signing,
        stations=stations,
        speedup=speedup,
    )


def mavsdk_link(mission: Mission, forward: Sequence[str], speedup: float) -> MavsdkLink:
    """A link that lets MAVSDK speak MAVLink and move the bytes.

    Args:
        mission: The mission.
        forward: Other ground stations that MAVLink is to be passed on to: MAVSDK cannot.
        speedup: Seconds of mission time per second.

    Raises:
        UsageError: If the mission or the caller wants what the MAVSDK link does not do.
    """
    unable = [
        what
        for what, wanted in (
            ("sign (swarm.signing_key_file)", mission.swarm.signing_key_file),
            ("upload a fence (limits.upload_geofence)", mission.limits.upload_geofence),
            ("pass MAVLink on (--forward)", forward),
        )
        if wanted
    ]
    if unable:
        raise UsageError(
            f"swarm.backend is mavsdk, which does not {' or '.join(unable)}: leave that out, or fly"
            " with swarm.backend: native."
        )
    from swarmctl.link.mavsdk_link import MavsdkLink  # noqa: PLC0415 - a native flight does without

    return MavsdkLink(
        gcs_sysid=mission.swarm.gcs_sysid, vehicles=mission.swarm.sysids, speedup=speedup
    )


def station_addresses(forward: Sequence[str], first: int) -> list[Address]:
    """Addresses of other ground stations.

    Args:
        forward: Their URLs.
        first: Number of the first of their endpoints.

    Raises:
        UsageError: If one is not udpout://host:port.
    """
    addresses = []
    for number, text in enumerate(forward, first):
        url = parse_url(text)
        if url.scheme != "udpout":
            raise UsageError(
                f"--forward is {text!r}: it should be udpout://host:port, where the other ground"
                " station listens, as in udpout://127.0.0.1:14551."
            )
        addresses.append(Address(url.host, url.port, number))
    return addresses
