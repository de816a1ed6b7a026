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
        altitude_amsl_m: Its altitude during the whole mission, m. Two vehicles whose altitudes are
            ``limits.min_separation_m`` apart may cross; others fly round one another.
        max_speed_mps: Its greatest ground speed, if below ``limits.max_speed_mps``, m/s. The whole
            swarm then flies slowly enough for this vehicle.
        max_acceleration_mps2: Its greatest acceleration, if below
            ``limits.max_acceleration_mps2``, m/s².
    """

    sysid: SysId
    altitude_amsl_m: Altitude
    max_speed_mps: Positive | None = None
    max_acceleration_mps2: Positive | None = None


class Swarm(Section):
    """The vehicles, and how they are reached.

    Attributes:
        name: Name of the swarm in MQTT topics.
        autopilot: The autopilot of all vehicles; with ``auto`` each vehicle's HEARTBEAT tells.
        link: Where the vehicles are reached by MAVLink, one URL or a list: ``udpin://host:port``
            listens, ``udpout://host:port`` and ``tcp://host:port`` call,
            ``serial:///dev/name:baud`` is a radio on a serial line.
        backend: The library that speaks MAVLink: ``native`` (swarmctl's own) or ``mavsdk``
            (MAVSDK 4; it cannot sign, forward or upload fences).
        signing_key_file: File with the key that signs MAVLink, relative to the mission file:
            32 bytes, 64 hexadecimal digits or a passphrase. With a key, unsigned messages are
            refused.
        gcs_sysid: The MAVLink system id of swarmctl itself (QGroundControl has 255).
        set_failsafes: Whether swarmctl may set failsafe parameters that would not bring the
            vehicles home safely and apart. It restores the old values after the flight. If
            ``false``, it refuses to fly such vehicles.
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
    """Limits that every command keeps. Distances are measured in three dimensions.

    Attributes:
        d_max_m: Greatest distance of a companion from the reference UAV (communication range), m.
        min_separation_m: Least distance between two UAVs, m.
        stand_off_m: Least distance of any UAV from the emitter, m.
        cruise_speed_mps: Speed of the swarm on its way to the emitter, m/s.
        max_speed_mps: Greatest ground speed that any vehicle is commanded to fly, m/s.
        max_acceleration_mps2: Greatest acceleration that any vehicle is commanded to fly, m/s².
        ceiling_amsl_m: Greatest altitude of any vehicle, m.
        geofence_radius_m: Greatest horizontal distance of any vehicle from the origin, m.
        upload_geofence: Whether swarmctl uploads a geofence to every vehicle before take-off: a
            circle round the origin, 30 m wider than ``geofence_radius_m``. It replaces any fence
            that the vehicle had. The vehicle's own parameters decide what it does at the fence.
        battery_reserve: Charge of a battery, as a fraction, below which the swarm returns.
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
    """Where the companions stand.

    Attributes:
        design: The formation design: ``optimal`` (computed for the mission's noise and range),
            ``paper`` (the paper's Eqs. 29 and 31), ``uniform`` (its Remark 2), ``regression`` or
            ``worst_case``.
        sigma_rd_m: Expected 1-sigma of a range difference, m. The optimal design depends on it.
        rho: Share of a range difference's variance that comes from the reference receiver.
        min_companions: Least number of companions. With fewer the swarm returns; otherwise the
            others close up when one is lost, and fly on.
        margin_m: Distance that the slots keep from ``limits.d_max_m``, m.
        stand_off_margin_m: Distance that the swarm keeps beyond ``limits.stand_off_m``, m.
        separation_margin_m: Distance that plans keep beyond ``limits.min_separation_m`` between
            vehicles whose altitudes differ by less than that, m. Wind and lag use it up.
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
        timeout_s: Time without any range difference after which the swarm returns, s.
    """

    broker: BrokerUrl
    timeout_s: Positive = 20.0


class Filter(Section):
    """The filter, and what it assumes of receivers and emitter.

    Attributes:
        kind: The filter's name. ``tracker`` copes with all the errors below and with echoes, and
            can begin with a sector; ``ncrkf`` is the linear filter alone, for good clocks and
            white errors.
        sigma_p_m: 1-sigma of the white error of a reported UAV position, per axis, m.
        process_noise_mps_per_sqrt_s: Random walk of the emitter's horizontal velocity, m/s per √s.
        navigation_sigma_m: 1-sigma of the slowly changing error of a reported UAV position, per
            axis, m.
        navigation_tau_s: Correlation time of that error, s.
        clock_bias_ns: 1-sigma of a receiver's clock error at the first measurement, ns.
        clock_drift_ns_per_s: 1-sigma of a receiver's clock drift, ns/s.
        colour_sigma_m: 1-sigma of an arrival's correlated error (multipath), m.
        colour_tau_s: Correlation time of that error, s.
        manoeuvre_speed_mps: Top speed of an emitter that may turn or stop, m/s; 0 for one that
            drifts or stands still.
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
        bearing_deg: Compass bearing of the sector's middle, degrees.
        width_deg: Angle from edge to edge, degrees; 360 for all around.
        nearest_m: Least distance of the emitter from the origin, m.
        farthest_m: Greatest distance of the emitter from the origin, m.
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
        sigma_m: 1-sigma of the emitter's horizontal position about the place, per axis, m.
        sector: The sector, instead of ``lat_deg``, ``lon_deg`` and ``sigma_m``.
        alt_amsl_m: The emitter's altitude above mean sea level, m.
        altitude_sigma_m: 1-sigma of that altitude, m; about 1 on the surface of the sea.
        speed_sigma_mps: 1-sigma of the emitter's horizontal velocity, per axis, m/s.
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
        sigma_m: Larger 1-sigma axis of the horizontal position below which the emitter counts as
            located, m.
        orbit_s: Time that the swarm observes from its orbit, s.
        time_limit_s: Time after the start at which the swarm returns at the latest, s.
    """

    sigma_m: Positive = 5.0
    orbit_s: Positive = 60.0
    time_limit_s: Positive = 1800.0


class Mission(Section):
    """A whole mission file.

    Attributes:
        name: Name of the mission and of its recordings.
        description: One line for the console.
        swarm: The vehicles, and how they are reached.
        origin: Zero of the local east-north-up coordinates: the launch area at ground level.
        limits: Limits that every command keeps.
        formation: Where the companions stand.
        feed: The measurement feed.
        filter: The filter, and what it assumes of receivers and emitter.
        emitter: Where the emitter is believed to be before any measurement.
        goal: When the mission is done.
        sim: The simulated truth; real vehicles' missions leave it out.
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
