"""Parameters: names, types and how values cross the wire."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilots import ardupilot_parameters, px4_parameters
from sim.autopilots.parameters import INT8, INT32, REAL32, Parameter, Parameters

SOME = {
    "A": Parameter(INT8, 1.0),
    "B": Parameter(INT32, 2.0),
    "C": Parameter(REAL32, 0.5),
}


def request(name: str, value: float, kind: int) -> mavlink.MAVLink_param_set_message:
    # By the wire, as it comes: a decoded name is a string.
    codec = mavlink.MAVLink(None)
    data = mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, kind).pack(codec)
    (message,) = codec.parse_buffer(data)
    return message


@given(st.integers(-(2**31), 2**31 - 1))
def test_whole_numbers_survive_byte_by_byte(value: int) -> None:
    (encoded,) = struct.unpack("<f", struct.pack("<i", value))
    if struct.pack("<f", encoded) != struct.pack("<i", value):
        return  # a signalling NaN, which a machine's float does not keep
    parameters = Parameters(SOME, bytewise=True)
    assert parameters.take(request("B", encoded, INT32))
    assert parameters["B"] == value
    echo = parameters.message("B").param_value
    assert struct.pack("<f", echo) == struct.pack("<i", value)


def test_whole_numbers_are_rounded_and_bounded_as_floats() -> None:
    parameters = Parameters(SOME, bytewise=False)
    assert parameters.take(request("A", 3.6, REAL32))
    assert parameters["A"] == 4.0
    assert parameters.take(request("A", 1e9, REAL32))
    assert parameters["A"] == 127.0
    assert parameters.message("A").param_value == 127.0


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_what_is_no_number_or_of_another_type_is_not_taken(value: float) -> None:
    assert not Parameters(SOME, bytewise=False).take(request("C", value, REAL32))
    assert not Parameters(SOME, bytewise=True).take(request("B", 1.0, REAL32))
    assert not Parameters(SOME, bytewise=True).take(request("NO", 1.0, REAL32))


@pytest.mark.parametrize(
    ("release", "system", "height", "metres"),
    [
        ("4.6", "SYSID_THISMAV", "RTL_ALT", 1500.0),
        ("4.7-dev", "MAV_SYSID", "RTL_ALT", 1500.0),
        ("4.7", "MAV_SYSID", "RTL_ALT_M", 15.0),
    ],
)
def test_each_release_has_its_names_and_units(
    release: str, system: str, height: str, metres: float
) -> None:
    parameters = ardupilot_parameters.parameters(release, 7)
    assert parameters.message(system).param_value == 7
    assert parameters.message(height).param_value == pytest.approx(metres)
    # What acts is the same by whatever name.
    assert parameters["RTL_ALT"] == pytest.approx(1500.0)
    assert ("MAV1_EXTRA1" in parameters) is (release != "4.6")
    assert ("SR0_EXTRA1" in parameters) is (release == "4.6")


def test_names_fit_the_message_and_come_in_order() -> None:
    for parameters in (
        ardupilot_parameters.parameters("4.7", 1),
        px4_parameters.parameters(1),
    ):
        assert max(map(len, parameters.names)) <= 16
        assert len(parameters.names) > 400
        for index, name in enumerate(parameters.names):
            message = parameters.message(name)
            assert (message.param_index, message.param_count) == (index, len(parameters.names))
