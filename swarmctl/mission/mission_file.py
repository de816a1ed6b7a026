"""The mission file as frozen data: what may be in it, with units and bounds.

Field names carry their units. Angles are degrees here and only here (an operator writes the file);
properties give radians. :func:`swarmctl.mission.mission_file_loading.load_mission` reads a file and
reports every fault in it.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from swarmctl.frames import LocalFrame
from swarmctl.mission.mission_file_fields import (
    Altitude,
    BrokerUrl,
    Links,
    Name,
    NonNegative,
    Position,
    Positive,
    Section,
    SysId,
)
from swarmctl.mission.mission_file_simulation import Simulation


class Vehicle(Section):
    """One UAV.

    Attributes:
        sysid: Its MAVLink system id.
        altitude_amsl_m: The altitude it flies at, all mission long. Vehicles at altitudes
            ``limits.min_separation_m`` apart may cross; others go round one another.
        max_speed_mps: Its greatest ground speed, where that is below ``limits.max_speed_mps``:
            the swarm flies no faster than it can keep up with.
        max_acceleration_mps2: Likewise its greatest acceleration.
    """

    sysid: SysId
    altitude_amsl_m: Altitude
    max_speed_mps: Positive | None = None
    max_acceleration_mps2: Positive | None = None


class Swarm(Section):
    """Who flies, and how they are reached.

    Attributes:
        name: Used in MQTT topics.
        autopilot: The flight stack of all vehicles; ``auto`` takes what each says of itself.
        link: Where MAVLink comes from, one URL or a list: ``udpin://host:port`` listens,
            ``udpout://host:port`` and ``tcp://host:port`` call, ``serial:///dev/name:baud``
            is a radio on a serial line.
        backend: Who speaks MAVLink on the link: ``native``, or ``mavsdk`` (MAVSDK 4;
            without signing, forwarding and uploaded fences).
        signing_key_file: File with the key that signs MAVLink, found from the mission file:
            32 bytes, 64 hexadecimal digits or a passphrase. What is not signed is refused.
        gcs_sysid: The controller's own MAVLink system id (255 is QGroundControl's).
        set_failsafes: Whether swarmctl may set the vehicles' failsafe parameters for the flight
            where they would not bring the swarm home safely and apart; they are restored after
            it. Without, it refuses to fly such vehicles.
        reference: System id of the reference UAV.
        vehicles: All UAVs, the reference included.
    """

    name: Name
    autopilot: Literal["auto", "ardupilot", "px4"] = "auto"
    link: Links
    backend: Literal["native", "mavsdk"] = "native"
    signing_key_file: str = ""
    gcs_sysid: SysId = 245
    set_failsafes: bool = False
    reference: SysId
    vehicles: Annotated[tuple[Vehicle, ...], Field(min_length=2, max_length=13)]

    @property
    def sysids(self) -> tuple[int, ...]:
        """System ids of all vehicles, in the file's order."""
        return tuple(v.sysid for v in self.vehicles)


class Limits(Section):
    """What bounds every command. Distances are 3-D.

    Attributes:
        d_max_m: Communication range: greatest distance of a companion from the reference UAV.
        min_separation_m: Least distance between two UAVs.
        stand_off_m: Least distance of any UAV from the emitter.
        cruise_speed_mps: Speed of the swarm on its way.
        max_speed_mps: Greatest ground speed commanded to any vehicle.
        max_acceleration_mps2: Greatest acceleration commanded.
        ceiling_amsl_m: Greatest altitude.
        geofence_radius_m: Greatest horizontal distance from the origin.
        upload_geofence: Whether every vehicle is given a fence of its own before take-off, a
            circle round the origin some metres wider, in place of any it had. What it does at
            the fence is for its own parameters to say.
        battery_reserve: The swarm returns when any battery is below this fraction.
    """

    d_max_m: Positive
    min_separation_m: Positive
    stand_off_m: Positive
    cruise_speed_mps: Positive
    max_speed_mps: Positive
    max_acceleration_mps2: Positive = 2.0
    ceiling_amsl_m: Altitude
    geofence_radius_m: Positive
    upload_geofence: bool = False
    battery_reserve: Annotated[float, Field(ge=0.0, le=0.9)] = 0.25


class Formation(Section):
    """How the companions stand.

    Attributes:
        design: ``optimal`` for the mission's noise and range; ``paper`` (its Eqs. 29 and 31),
            ``uniform`` (its Remark 2), ``regression`` or ``worst_case``.
        sigma_rd_m: 1-sigma of a range difference to expect; shapes the optimal design.
        rho: Share of its variance that comes from the reference receiver.
        min_companions: With fewer companions left the swarm returns; with more, the others
            close up and fly on without a lost one.
        margin_m: Slots are drawn at ``d_max_m`` less this.
        stand_off_margin_m: The swarm keeps this much more than ``stand_off_m``.
        separation_margin_m: Vehicles whose altitudes differ by less than
            ``limits.min_separation_m`` are planned this much farther apart, for what wind and lag
            make of a plan.
    """

    design: Literal["optimal", "paper", "uniform", "regression", "worst_case"] = "optimal"
    sigma_rd_m: Positive = 3.0
    rho: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.5
    min_companions: Annotated[int, Field(ge=1)] = 1
    margin_m: Positive = 15.0
    stand_off_margin_m: Positive = 25.0
    separation_margin_m: Positive = 5.0


class Feed(Section):
    """The measurement feed.

    Attributes:
        broker: ``mqtt://[user:password@]host:port``, or ``mqtts://`` for TLS.
        timeout_s: The swarm returns when no range difference came for this long.
    """

    broker: BrokerUrl
    timeout_s: Positive = 20.0


class Filter(Section):
    """What the tracker assumes.

    Attributes:
        kind: ``tracker`` copes with all that is listed here, with echoes, and with a sector to
            look in; ``ncrkf`` is the linear filter alone, for good clocks and white errors.
        sigma_p_m: 1-sigma of the white error of a reported UAV position, per axis.
        process_noise_mps_per_sqrt_s: Random walk of the emitter's horizontal velocity.
        navigation_sigma_m: 1-sigma of the slowly changing error of a UAV's positions, per axis.
        navigation_tau_s: Its correlation time.
        clock_bias_ns: 1-sigma of a receiver's clock error at the first measurement.
        clock_drift_ns_per_s: 1-sigma of its drift.
        colour_sigma_m: 1-sigma of an arrival's correlated error (multipath).
        colour_tau_s: Its correlation time.
        manoeuvre_speed_mps: Top speed of an emitter that may turn or stop; 0 for one that
            drifts or stands.
    """

    kind: Literal["tracker", "ncrkf"] = "tracker"
    sigma_p_m: NonNegative = 0.5
    process_noise_mps_per_sqrt_s: NonNegative = 0.02
    navigation_sigma_m: NonNegative = 0.0
    navigation_tau_s: Positive = 60.0
    clock_bias_ns: NonNegative = 0.0
    clock_drift_ns_per_s: NonNegative = 0.0
    colour_sigma_m: NonNegative = 0.0
    colour_tau_s: Positive = 0.5
    manoeuvre_speed_mps: NonNegative = 0.0


class Sector(Section):
    """A sector to look in, seen from the origin.

    Attributes:
        bearing_deg: Compass bearing of its middle.
        width_deg: From edge to edge; 360 for all around.
        nearest_m: Least distance of the emitter.
        farthest_m: Greatest distance.
    """

    bearing_deg: Annotated[float, Field(ge=0.0, lt=360.0)]
    width_deg: Annotated[float, Field(gt=0.0, le=360.0)]
    nearest_m: NonNegative
    farthest_m: Positive


class EmitterPrior(Section):
    """Where the emitter is believed to be before any measurement: about a place, or in a sector.

    Attributes:
        lat_deg: Latitude of the place, degrees.
        lon_deg: Longitude of the place, degrees.
        sigma_m: 1-sigma of the horizontal position about the place, per axis.
        sector: The sector, instead of these three.
        alt_amsl_m: Altitude above mean sea level, m.
        altitude_sigma_m: 1-sigma of the altitude (the sea's surface: about a metre).
        speed_sigma_mps: 1-sigma of the horizontal velocity, per axis.
    """

    lat_deg: Annotated[float, Field(ge=-85.0, le=85.0)] | None = None
    lon_deg: Annotated[float, Field(ge=-180.0, le=180.0)] | None = None
    sigma_m: Positive | None = None
    sector: Sector | None = None
    alt_amsl_m: Altitude
    altitude_sigma_m: Positive = 1.0
    speed_sigma_mps: Positive = 2.0


class Goal(Section):
    """When the mission is done.

    Attributes:
        sigma_m: The emitter counts as located when the larger 1-sigma axis is below this.
        orbit_s: Time to observe from the orbit.
        time_limit_s: The swarm returns at the latest this long after the start.
    """

    sigma_m: Positive = 5.0
    orbit_s: Positive = 60.0
    time_limit_s: Positive = 1800.0


class Mission(Section):
    """A whole mission file.

    Attributes:
        name: Name of the mission; names the recording.
        description: One line for the console.
        swarm: Who flies.
        origin: Where local east-north-up coordinates are zero: the launch area, ground level.
        limits: What bounds every command.
        formation: How the companions stand.
        feed: Where the range differences come from.
        filter: What the tracker assumes.
        emitter: Where the emitter is believed to be before any measurement.
        goal: When the mission is done.
        sim: The truth; left out of a mission for real vehicles.
    """

    name: Name
    description: str = ""
    swarm: Swarm
    origin: Position
    limits: Limits
    formation: Formation = Formation()
    feed: Feed
    filter: Filter = Filter()
    emitter: EmitterPrior
    goal: Goal = Goal()
    sim: Simulation | None = None

    @property
    def frame(self) -> LocalFrame:
        """The local ENU frame of the mission."""
        return LocalFrame(*self.origin.geodetic)
