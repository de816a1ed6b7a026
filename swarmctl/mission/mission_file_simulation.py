"""The simulation section of a mission file: the truth, which the controller never reads."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from swarmctl.mission.mission_file_fields import NonNegative, Position, Positive, Section, SysId

Detour = Annotated[float, Field(ge=0.0, le=1e4)]


class SimEmitter(Position):
    """The true emitter of a simulation.

    Attributes:
        drift_mps: Speed of its drift.
        course_deg: Compass direction it drifts towards.
        wander_mps_per_sqrt_s: Random walk of its horizontal velocity, per axis.
    """

    drift_mps: NonNegative = 0.0
    course_deg: Annotated[float, Field(ge=0.0, lt=360.0)] = 0.0
    wander_mps_per_sqrt_s: NonNegative = 0.0


class SimReceivers(Section):
    """The simulated receivers.

    Attributes:
        rate_hz: Bursts a second; 0.02 is one every 50 s.
        sigma_m: 1-sigma of a range difference's white noise: the errors below come on top.
        rho: Share of its variance that the reference receiver contributes.
        clock_bias_sigma_ns: 1-sigma of each receiver's clock error at the start (1 ns is 0.3 m);
            drawn once for each.
        clock_drift_sigma_ns_per_s: 1-sigma of each clock's constant drift.
        nlos_share: Share of the arrivals, at each receiver by itself, that come by an echo
            instead of the direct path.
        nlos_min_m: Least detour of an echo.
        nlos_max_m: Greatest detour of an echo; between the two, all are equally frequent.
        colour_sigma_m: 1-sigma of the coloured error of every receiver's arrivals (first-order
            Gauss-Markov): what multipath does; a range difference has the square root of 2 of
            it.
        colour_tau_s: Its correlation time.
        publish: What is published of each burst: range differences against the reference, or
            arrival times, which outlive its loss. The errors are the same.
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
        white_sigma_m: White part.
        correlated_sigma_m: First-order Gauss-Markov part; the vehicle flies it, too.
        correlated_tau_s: Its correlation time.
    """

    white_sigma_m: NonNegative = 0.5
    correlated_sigma_m: NonNegative = 0.0
    correlated_tau_s: Positive = 60.0


class SimWind(Section):
    """The simulated wind.

    Attributes:
        speed_mps: Mean speed.
        from_deg: Compass direction it comes from.
        gust_sigma_mps: 1-sigma of the gusts, per axis.
    """

    speed_mps: Annotated[float, Field(ge=0.0, le=30.0)] = 0.0
    from_deg: Annotated[float, Field(ge=0.0, lt=360.0)] = 0.0
    gust_sigma_mps: NonNegative = 0.0


class SimFault(Section):
    """Something that goes wrong with one simulated vehicle.

    Attributes:
        sysid: The vehicle.
        kind: ``silent`` (never says a word), ``refuses_arming``, ``other_key`` (signs with
            another key than the mission's) or ``dies`` (falls silent).
        at_s: Simulation time of ``dies``.
    """

    sysid: SysId
    kind: Literal["silent", "refuses_arming", "other_key", "dies"]
    at_s: NonNegative = 0.0


class Simulation(Section):
    """The truth, for missions that are simulated. The controller never reads this section.

    Attributes:
        seed: Seed of every random draw.
        autopilot: Whose manners the vehicles have.
        full_boot: Whether the vehicles boot as slowly as real ones, or in a few seconds.
        launch_spacing_m: Distance between launch points, eastwards from the origin.
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
