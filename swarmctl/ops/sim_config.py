"""A mission's ``sim`` section as the configuration of the simulator.

The simulator is told of a mission only through this plain configuration.
"""

from __future__ import annotations

import hashlib
import math

from sim.config import (
    ClockConfig,
    EmitterConfig,
    NavigationConfig,
    ReceiverConfig,
    SimConfig,
    VehicleConfig,
    WindConfig,
)
from sim.faults import Faults
from swarmctl.errors import UsageError
from swarmctl.frames import sped_up_utc_s
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.mission_file_simulation import Simulation
from swarmctl.ops.mission_signing import signing_key

OWNERS_PARAMETERS = {
    "ardupilot": (("WPNAV_SPEED", 1500.0), ("WPNAV_SPEED_UP", 300.0), ("BATT_FS_LOW_ACT", 2.0)),
    "px4": (("MPC_XY_VEL_MAX", 15.0),),
}
"""Parameters that the owner of the simulated vehicles has set: full speed of the airframe, and
return on a low battery."""


def sim_config(
    mission: Mission, seed: int | None, utc_start_s: float, speedup: float = 1.0
) -> SimConfig:
    """The simulator's configuration for a mission.

    Args:
        mission: A mission with a ``sim`` section.
        seed: Overrides the section's seed.
        utc_start_s: UTC at simulation time 0, s.
        speedup: Simulated seconds per second. As in SITL, UTC follows it on an ArduCopter but
            not on a PX4.

    Raises:
        UsageError: If the mission has no ``sim`` section, or its signing key cannot be read.
    """
    key = signing_key(mission)
    other_key = hashlib.sha256(b"another than" + (key or b"")).digest()
    section = simulation_section(mission)
    clock = ClockConfig(speedup=speedup if section.autopilot == "px4" else 1.0)
    faults = {fault.sysid: fault for fault in section.faults}
    vehicles = []
    for i, sysid in enumerate(mission.swarm.sysids):
        lat, lon, alt = mission.frame.to_geodetic(i * section.launch_spacing_m, 0.0, 0.0)
        fault = faults.get(sysid)
        kind = fault.kind if fault is not None else None
        vehicles.append(
            VehicleConfig(
                sysid=sysid,
                launch_lat_rad=lat,
                launch_lon_rad=lon,
                launch_alt_amsl_m=alt,
                autopilot=section.autopilot,
                parameters=OWNERS_PARAMETERS[section.autopilot],
                signing_key=other_key if kind == "other_key" else key,
                full_boot=section.full_boot,
                clock=clock,
                boot_delay_s=0.1 * i,
                faults=Faults(
                    silent=kind == "silent",
                    refuses_arming=kind == "refuses_arming",
                    dies_at_s=fault.at_s if fault is not None and kind == "dies" else None,
                ),
            )
        )
    emitter, wind = section.emitter, section.wind
    lat, lon, alt = emitter.geodetic
    return SimConfig(
        swarm=mission.swarm.name,
        vehicles=tuple(vehicles),
        emitter=EmitterConfig(
            lat_rad=lat,
            lon_rad=lon,
            alt_amsl_m=alt,
            velocity_enu=_towards(emitter.course_deg, emitter.drift_mps),
            wander_mps_per_sqrt_s=emitter.wander_mps_per_sqrt_s,
        ),
        receivers=ReceiverConfig(
            reference=mission.swarm.reference,
            rate_hz=section.receivers.rate_hz,
            sigma_m=section.receivers.sigma_m,
            rho=section.receivers.rho,
            clock_bias_sigma_s=1e-9 * section.receivers.clock_bias_sigma_ns,
            clock_drift_sigma=1e-9 * section.receivers.clock_drift_sigma_ns_per_s,
            nlos_share=section.receivers.nlos_share,
            nlos_min_m=section.receivers.nlos_min_m,
            nlos_max_m=section.receivers.nlos_max_m,
            colour_sigma_m=section.receivers.colour_sigma_m,
            colour_tau_s=section.receivers.colour_tau_s,
            publish=section.receivers.publish,
        ),
        navigation=NavigationConfig(
            white_sigma_m=section.navigation.white_sigma_m,
            correlated_sigma_m=section.navigation.correlated_sigma_m,
            correlated_tau_s=section.navigation.correlated_tau_s,
        ),
        wind=WindConfig(
            mean_enu=_towards(wind.from_deg + 180.0, wind.speed_mps),
            gust_sigma_mps=wind.gust_sigma_mps,
        ),
        seed=section.seed if seed is None else seed,
        utc_start_s=sped_up_utc_s(utc_start_s, clock.speedup),
    )


def simulation_section(mission: Mission) -> Simulation:
    """The mission's ``sim`` section.

    Raises:
        UsageError: If it has none.
    """
    if mission.sim is None:
        raise UsageError(
            f"the mission {mission.name} has no sim section: only a mission that says where the"
            " simulated emitter is can be simulated. Add one, or fly real vehicles with"
            " `swarmctl run`."
        )
    return mission.sim


def _towards(course_deg: float, speed_mps: float) -> tuple[float, float, float]:
    course = math.radians(course_deg)
    return (speed_mps * math.sin(course), speed_mps * math.cos(course), 0.0)
