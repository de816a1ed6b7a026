"""The simulation section of a mission file: the truth, which the controller never reads."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from swarmctl.mission.mission_file_fields import NonNegative, Position, Positive, Section, SysId

Detour = Annotated[float, Field(ge=0.0, le=1e4)]


class SimEmitter(Position):
    """The true emitter of a simulation.

    Attributes:
        drift_mps: Speed at which the emitter drifts, m/s.
        course_deg: Compass direction that the emitter drifts towards, degrees.
        wander_mps_per_sqrt_s: Random walk of the emitter's horizontal velocity, per axis,
            m/s per √s.
    """

    drift_mps: NonNegative = 0.0
    course_deg: Annotated[float, Field(ge=0.0, lt=360.0)] = 0.0
    wander_mps_per_sqrt_s: NonNegative = 0.0


class SimReceivers(Section):
    """The simulated receivers.

    Attributes:
        rate_hz: Bursts a second; 0.02 is one every 50 s.
        sigma_m: 1-sigma of a range difference's white noise, m. The errors below are added to it.
        rho: Share of that variance that comes from the reference receiver.
        clock_bias_sigma_ns: 1-sigma of each receiver's clock error at the start, ns (1 ns is
            0.3 m). It is drawn once for each receiver.
        clock_drift_sigma_ns_per_s: 1-sigma of each clock's constant drift, ns/s.
        nlos_share: Share of each receiver's arrivals that come by an echo instead of the direct
            path.
        nlos_min_m: Least detour of an echo, m.
        nlos_max_m: Greatest detour of an echo, m. Detours are uniform between the two.
        colour_sigma_m: 1-sigma of the correlated error of each receiver's arrivals (multipath,
            first-order Gauss-Markov), m. A range difference has √2 times as much.
        colour_tau_s: Correlation time of that error, s.
        publish: What is published of each burst: range differences against the reference, or
            arrival times, which go on when the reference is lost. Both have the same errors.
    """

    rate_hz: Annotated[float, Field(ge=1e-3, le=50.0)] = 10.0
    sigma_m: Positive = 3.0
    rho: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.5
    clock_bias_sigma_ns: Annotated[float, Field(ge=0.0, le=1e5)] = 0.0
    clock_drift_sigma_ns_per_s: Annotated[float, Field(ge=0.0, le=1e3)] = 0.0
    nlos_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    nlos_min_m: Detour = 50.0
    nlos_max_m: Detour = 300.0
    colour_sigma_m: Annotated[float, Field(ge=0.0, le=1e4)] = 0.0
    colour_tau_s: Positive = 0.5
    publish: Literal["range_differences", "arrival_times"] = "range_differences"


class SimNavigation(Section):
    """The error of the positions that simulated vehicles report, per axis.

    Attributes:
        white_sigma_m: 1-sigma of the white part, m.
        correlated_sigma_m: 1-sigma of the correlated part (first-order Gauss-Markov), m. The
            vehicle steers by it, so it flies off by as much.
        correlated_tau_s: Correlation time of the correlated part, s.
    """

    white_sigma_m: NonNegative = 0.5
    correlated_sigma_m: NonNegative = 0.0
    correlated_tau_s: Positive = 60.0


class SimWind(Section):
    """The simulated wind.

    Attributes:
        speed_mps: Mean speed, m/s.
        from_deg: Compass direction that the wind comes from, degrees.
        gust_sigma_mps: 1-sigma of the gusts, per axis, m/s.
    """

    speed_mps: Annotated[float, Field(ge=0.0, le=30.0)] = 0.0
    from_deg: Annotated[float, Field(ge=0.0, lt=360.0)] = 0.0
    gust_sigma_mps: NonNegative = 0.0


class SimFault(Section):
    """Something that goes wrong with one simulated vehicle.

    Attributes:
        sysid: The vehicle's system id.
        kind: What goes wrong: ``silent`` (it never sends anything), ``refuses_arming``,
            ``other_key`` (it signs with another key than the mission's) or ``dies`` (it falls
            silent).
        at_s: Simulation time at which a vehicle that ``dies`` falls silent, s.
    """

    sysid: SysId
    kind: Literal["silent", "refuses_arming", "other_key", "dies"]
    at_s: NonNegative = 0.0


class Simulation(Section):
    """The truth of a simulated mission. The controller never reads this section.

    Attributes:
        seed: Seed of every random draw.
        autopilot: The autopilot that the vehicles behave like.
        full_boot: Whether the vehicles boot as slowly as real ones; otherwise they need a few
            seconds.
        launch_spacing_m: Distance between launch points, which lie eastwards from the origin, m.
        emitter: The true emitter.
        receivers: The receivers.
        navigation: Errors of the reported positions.
        wind: The wind.
        faults: What goes wrong.
    """

    seed: Annotated[int, Field(ge=0)] = 0
    autopilot: Literal["ardupilot", "px4"] = "ardupilot"
    full_boot: bool = False
    launch_spacing_m: Positive = 20.0
    emitter: SimEmitter
    receivers: SimReceivers = SimReceivers()
    navigation: SimNavigation = SimNavigation()
    wind: SimWind = SimWind()
    faults: tuple[SimFault, ...] = ()
