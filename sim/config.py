"""The configuration of a simulation: plain frozen data, filled by whoever starts one.

Units are SI and radians, altitudes AMSL; wind and drift are velocities of air or water, ENU.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from sim.faults import Faults
from swarmctl.units import Vector

Publication = Literal["range_differences", "arrival_times"]


@dataclass(frozen=True)
class VehicleLimits:
    """What the simulated multirotor can do.

    Attributes:
        speed_mps: Greatest horizontal speed over ground.
        acceleration_mps2: Greatest horizontal acceleration.
        climb_mps: Greatest climb and descent speed.
        climb_acceleration_mps2: Greatest vertical acceleration.
        jerk_mps3: Greatest rate of change of the acceleration, horizontal and vertical; the
            default reaches the greatest acceleration in a fifth of a second.
    """

    speed_mps: float = 15.0
    acceleration_mps2: float = 3.0
    climb_mps: float = 3.0
    climb_acceleration_mps2: float = 2.0
    jerk_mps3: float = 15.0


@dataclass(frozen=True)
class ClockConfig:
    """Errors of a vehicle's clock.

    Attributes:
        drift: Seconds that its time since boot gains in a second.
        utc_offset_s: Offset of the UTC it reports, s.
        utc_jitter_s: Standard deviation of each report of UTC, s.
        speedup: How much faster than the UTC it reports the simulation runs. PX4's SITL reports
            the computer's UTC, whatever the speed of the simulation.
    """

    drift: float = 0.0
    utc_offset_s: float = 0.0
    utc_jitter_s: float = 0.0
    speedup: float = 1.0


@dataclass(frozen=True)
class VehicleConfig:
    """One simulated UAV.

    Attributes:
        sysid: MAVLink system id.
        launch_lat_rad: Launch point latitude, rad.
        launch_lon_rad: Launch point longitude, rad.
        launch_alt_amsl_m: Ground level at the launch point, m.
        limits: Performance.
        autopilot: Its autopilot.
        parameters: Parameters that its owner has set; the others have their defaults.
        parameter_names: The ArduPilot release that names its parameters.
        knows_intervals: Whether it knows SET_MESSAGE_INTERVAL and REQUEST_MESSAGE; ArduPilot
            before 4.0 knows only REQUEST_DATA_STREAM.
        full_boot: Whether it boots as slowly as the real autopilot, or in a few seconds.
        signing_key: Key that signs all messages in both directions, 32 bytes; None for a vehicle
            that does not sign.
        clock: Errors of its clock.
        boot_delay_s: Simulation time at which it powers up, s.
        faults: Its faults.
        charge: Battery charge at the start, 0..1.
    """

    sysid: int
    launch_lat_rad: float
    launch_lon_rad: float
    launch_alt_amsl_m: float
    limits: VehicleLimits = field(default_factory=VehicleLimits)
    autopilot: Literal["ardupilot", "px4"] = "ardupilot"
    parameters: tuple[tuple[str, float], ...] = ()
    parameter_names: Literal["4.6", "4.7-dev", "4.7"] = "4.7-dev"
    knows_intervals: bool = True
    full_boot: bool = False
    signing_key: bytes | None = None
    clock: ClockConfig = field(default_factory=ClockConfig)
    boot_delay_s: float = 0.0
    faults: Faults = field(default_factory=Faults)
    charge: float = 1.0


@dataclass(frozen=True)
class EmitterConfig:
    """The emitter: starts somewhere and drifts.

    Attributes:
        lat_rad: Latitude at the start, rad.
        lon_rad: Longitude at the start, rad.
        alt_amsl_m: Altitude of the sea's surface or the ground, m.
        velocity_enu: Mean drift, m/s.
        wander_mps_per_sqrt_s: Random walk of the horizontal velocity, m/s/sqrt(s): its standard
            deviation per axis after one second. The square is the process noise density of a
            constant-velocity model, m²/s³.
    """

    lat_rad: float
    lon_rad: float
    alt_amsl_m: float
    velocity_enu: Vector
    wander_mps_per_sqrt_s: float = 0.0


@dataclass(frozen=True)
class ReceiverConfig:
    """The radio receivers, one on every UAV.

    Attributes:
        reference: System id of the UAV whose receiver is the reference.
        rate_hz: Epochs per second.
        sigma_m: 1-sigma of a range difference, m.
        rho: Share of that variance that the reference receiver contributes.
        clock_bias_sigma_s: 1-sigma of each receiver's clock error at the start, s.
        clock_drift_sigma: 1-sigma of each clock's drift: seconds gained in a second.
        nlos_share: Share of the arrivals that come only by an echo (NLOS).
        nlos_min_m: Least detour of an echo, m.
        nlos_max_m: Greatest detour of an echo, m.
        colour_sigma_m: 1-sigma of the coloured (first-order Gauss-Markov) error of every
            receiver's arrivals, m.
        colour_tau_s: Correlation time of the coloured error, s.
        publish: Whether range differences against the reference are published, or the arrival
            times of every receiver. The errors are the same.
        delay_s: Time from an epoch to the publication of its measurements, s.
        minimum_altitude_m: A receiver lower than this above its launch point hears nothing.
    """

    reference: int
    rate_hz: float = 10.0
    sigma_m: float = 3.0
    rho: float = 0.5
    clock_bias_sigma_s: float = 0.0
    clock_drift_sigma: float = 0.0
    nlos_share: float = 0.0
    nlos_min_m: float = 50.0
    nlos_max_m: float = 300.0
    colour_sigma_m: float = 0.0
    colour_tau_s: float = 0.5
    publish: Publication = "range_differences"
    delay_s: float = 0.05
    minimum_altitude_m: float = 5.0


@dataclass(frozen=True)
class NavigationConfig:
    """Error of the positions the vehicles report, per axis.

    Attributes:
        white_sigma_m: 1-sigma of the white part, new in each report, m; the autopilot does not
            fly by it.
        correlated_sigma_m: 1-sigma of the first-order Gauss-Markov part, m; it is in the reports
            and in the autopilot's own solution, so that the vehicle flies off by it.
        correlated_tau_s: Correlation time of that part, s.
    """

    white_sigma_m: float = 0.5
    correlated_sigma_m: float = 0.0
    correlated_tau_s: float = 60.0


@dataclass(frozen=True)
class WindConfig:
    """Wind: a mean velocity of the air and a first-order Gauss-Markov gust per vehicle."""

    mean_enu: Vector = (0.0, 0.0, 0.0)
    gust_sigma_mps: float = 0.0
    gust_tau_s: float = 5.0


@dataclass(frozen=True)
class SimConfig:
    """A whole simulation.

    Attributes:
        swarm: Swarm name, used in topics.
        vehicles: The UAVs.
        emitter: The emitter.
        receivers: The receivers.
        navigation: Navigation error.
        wind: Wind.
        seed: Seed of every random draw.
        utc_start_s: UTC at simulation time 0, s. If a vehicle reports the computer's UTC, this
            and all measurements are in the sped-up time of
            :func:`swarmctl.frames.sped_up_utc_s`.
    """

    swarm: str
    vehicles: tuple[VehicleConfig, ...]
    emitter: EmitterConfig
    receivers: ReceiverConfig
    navigation: NavigationConfig = field(default_factory=NavigationConfig)
    wind: WindConfig = field(default_factory=WindConfig)
    seed: int = 0
    utc_start_s: float = 1_790_000_000.0
