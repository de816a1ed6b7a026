"""How a mission can end: every result, in one place."""

from __future__ import annotations

from enum import StrEnum


class MissionResult(StrEnum):
    """How a mission ended: ``result`` in ``summary.json``."""

    LOCATED = "located"
    """The emitter is located as the mission's goal wants it, and every vehicle is home."""
    NOT_LOCATED = "not_located"
    """The time limit passed before the emitter was located."""
    CANCELLED = "cancelled"
    """The operator asked for the return home."""

    VEHICLE_SILENT = "vehicle_silent"
    """A vehicle was not heard before take-off."""
    CLOCK_MISMATCH = "clock_mismatch"
    """The vehicles' clocks and the receivers' do not agree."""
    UNSAFE_FAILSAFES = "unsafe_failsafes"
    """A vehicle's failsafes would not bring it home."""
    NOT_READY = "not_ready"
    """A check before take-off did not pass in time."""
    MODE_REFUSED = "mode_refused"
    """A vehicle did not switch to guided mode."""
    ARMING_REFUSED = "arming_refused"
    """A vehicle did not arm."""
    TAKE_OFF_REFUSED = "take_off_refused"
    """A vehicle did not accept the command to take off."""
    TAKE_OFF_TIMEOUT = "take_off_timeout"
    """A vehicle did not reach its altitude in time."""

    VEHICLE_LOST = "vehicle_lost"
    """A vehicle fell silent or disarmed in flight."""
    VEHICLE_FAILSAFE = "vehicle_failsafe"
    """A vehicle left guided mode on a failsafe of its own."""
    TAKEN_OVER = "taken_over"
    """A pilot took a vehicle over."""
    LOW_BATTERY = "low_battery"
    """A vehicle's battery fell below the mission's reserve."""
    FEED_SILENT = "feed_silent"
    """No range difference that could be used came for too long."""
    PLAN_REJECTED = "plan_rejected"
    """No plan within the mission's limits could be found."""
