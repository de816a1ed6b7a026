"""What all simulated autopilots have in common: bytes in, bytes out, a command to the airframe.

It does no I/O: :meth:`Autopilot.receive` takes a datagram, :meth:`Autopilot.advance` simulates
one step, :meth:`Autopilot.datagrams` hands out what is to be sent. A subclass per autopilot fills
in the behaviour that was measured on the real one. Log and file transfer are not simulated: such
a command is unknown, such a message is ignored.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable

from sim.autopilots.battery import Battery
from sim.autopilots.command_handler import CommandHandler
from sim.autopilots.onboard_state import Installation, OnboardState
from sim.autopilots.parameters import Parameters, ParameterServer
from sim.dynamics import Command, State
from sim.mavlink import ACCEPTED, AUTOPILOT_COMPONENT, Message, dialect
from swarmctl.errors import SimulationError


class Autopilot(CommandHandler):
    """The autopilot of one UAV, listening from power-up on.

    Args:
        installation: What it is built into.
        parameters: Its parameters with their defaults.

    Raises:
        SimulationError: Its owner has set a parameter that it does not have.
    """

    def __init__(self, installation: Installation, parameters: Parameters) -> None:
        config = installation.config
        for name, value in config.parameters:
            if name not in parameters:
                raise SimulationError(
                    f"The simulated UAV {config.sysid} has no parameter {name}: "
                    f"name one that its {config.autopilot} autopilot has."
                )
            parameters.assign(name, value)
        mode = self.traits.first_mode
        super().__init__(
            OnboardState(
                *installation,
                self.traits,
                parameters,
                mode,
                mode.task(parameters),
                config.boot_delay_s,
                Battery(config.charge),
            )
        )
        self._parameters = ParameterServer(
            parameters, self.traits.parameters_per_s, self._codec.send
        )
        self._gcs_heard_s: float | None = None
        self._messages: dict[int, Callable[[Message, float], None]] = {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            dialect.MAVLINK_MSG_ID_COMMAND_LONG: self._on_command,
            dialect.MAVLINK_MSG_ID_COMMAND_INT: self._on_command,
            dialect.MAVLINK_MSG_ID_SET_MODE: self._on_set_mode,
            dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: self._on_setpoint,
            dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: self._on_setpoint,
            dialect.MAVLINK_MSG_ID_TIMESYNC: self._on_timesync,
            dialect.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: self._parameters.on_request_list,
            dialect.MAVLINK_MSG_ID_PARAM_REQUEST_READ: self._parameters.on_request_read,
            dialect.MAVLINK_MSG_ID_PARAM_SET: self._parameters.on_set,
            dialect.MAVLINK_MSG_ID_MISSION_COUNT: self._uploads.on_count,
            dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT: self._uploads.on_item,
            dialect.MAVLINK_MSG_ID_MISSION_REQUEST_LIST: lambda m, _: self._uploads.on_request_list(
                m
            ),
            dialect.MAVLINK_MSG_ID_MISSION_REQUEST_INT: self._on_mission_request,
            dialect.MAVLINK_MSG_ID_MISSION_REQUEST: self._on_mission_request,
            dialect.MAVLINK_MSG_ID_MISSION_SET_CURRENT: lambda m, _: self._on_set_current(m),
            dialect.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: lambda m, _: self._uploads.on_clear_all(m),
        }

    # --- Bytes and time ----------------------------------------------------------------

    def receive(self, datagram: bytes, now_s: float) -> None:
        """Take a datagram, whoever sends it.

        Args:
            datagram: Any bytes; what is not a message for this vehicle is ignored.
            now_s: Simulation time, s.
        """
        for message in self._codec.decode(datagram):
            if now_s < self._me.power_up_s:  # a reboot may be among the messages
                return
            handler = self._messages.get(message.get_msgId())
            if handler is not None and self._is_for_me(message):
                handler(message, now_s)

    def advance(self, now_s: float, truth: State) -> Command | None:
        """Simulate one time step; to be called at regular steps.

        Args:
            now_s: Simulation time, s.
            truth: True state of the airframe at that time.

        Returns:
            Command to the airframe until the next call; None with the rotors idle.
        """
        step_s = now_s - self._me.now_s
        was_armed = self._me.armed
        command = self._live(now_s, truth)
        self._follow_mission(was_armed)
        self._flush_after_ack()
        self._uploads.advance(now_s)
        self._parameters.advance(step_s)
        for message_id in self._intervals.due(now_s):
            self._send_telemetry(message_id)
        return command

    def datagrams(self) -> list[bytes]:
        """Hand out what is to be sent, one message each, in order; empties the queue."""
        return self._codec.drain()

    # --- What a subclass fills in ------------------------------------------------------

    @abstractmethod
    def _on_setpoint(self, message: Message, now_s: float) -> None:
        """SET_POSITION_TARGET_*."""

    @abstractmethod
    def _is_gcs(self, message: Message) -> bool:
        """Whether a HEARTBEAT comes from a ground station whose loss is a failsafe."""

    # --- Messages ----------------------------------------------------------------------

    def _is_for_me(self, message: Message) -> bool:
        """Whether target system and component name this autopilot; 0 means everyone."""
        # TIMESYNC and HEARTBEAT name no target, SET_MODE no component.
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in {0, self._me.config.sysid} and component in {0, AUTOPILOT_COMPONENT}

    def _on_heartbeat(self, message: Message, now_s: float) -> None:
        if self._is_gcs(message):
            self._gcs_heard_s = now_s

    def _gcs_silent_s(self) -> float:
        """Time since the ground station was last heard, s; 0 if it never was."""
        return 0.0 if self._gcs_heard_s is None else self._me.now_s - self._gcs_heard_s

    def _on_timesync(self, message: Message, now_s: float) -> None:
        if message.tc1 == 0:  # otherwise it is somebody's answer
            me = self._me
            boot_ns = round(me.clock.elapsed_s(now_s - me.power_up_s) * 1e9)
            self._codec.send(dialect.MAVLink_timesync_message(boot_ns, message.ts1))

    def _on_mission_request(self, message: Message, _now_s: float) -> None:
        me = self._me
        home = None
        if me.home_enu is not None:
            lat, lon, alt = me.frame.to_geodetic(*me.home_enu)
            home = (round(math.degrees(lat) * 1e7), round(math.degrees(lon) * 1e7), alt)
        self._uploads.on_request(message, home)

    def _on_set_current(self, message: Message) -> None:
        if self._go_to_item(message.seq) == ACCEPTED:
            self._send_telemetry(dialect.MAVLINK_MSG_ID_MISSION_CURRENT)

    def _restart(self) -> None:
        super()._restart()
        self._parameters.abort()
        self._gcs_heard_s = None
