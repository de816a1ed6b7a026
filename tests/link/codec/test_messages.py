"""Our names and numbers are those of MAVLink."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.link.codec.messages import MavCmd, MessageId


@pytest.mark.parametrize("command", MavCmd)
def test_command_numbers_are_mavlinks(command: MavCmd) -> None:
    assert getattr(mavlink, f"MAV_CMD_{command.name}") == command


@pytest.mark.parametrize("message_id", MessageId)
def test_message_numbers_are_mavlinks(message_id: MessageId) -> None:
    assert mavlink.mavlink_map[message_id].msgname == message_id.name
