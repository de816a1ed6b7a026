"""Parameters in bytes and in virtual time, with vehicles made of pymavlink at the other end."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.commands import ReadParameter, WriteParameter
from swarmctl.events import ParameterValue
from tests.link.bench import AnsweredBench
from tests.link.wire import Sender, unpack

ARDUPILOT, PX4 = 3, 12
INT32: int = mavlink.MAV_PARAM_TYPE_INT32
REAL32: int = mavlink.MAV_PARAM_TYPE_REAL32


class Vehicle(Sender):
    """Answers questions for parameters as its autopilot does; an unknown name with silence."""

    def __init__(self, autopilot: int, parameters: dict[str, float]) -> None:
        super().__init__(1)
        self.autopilot = autopilot
        self.parameters = parameters
        self.integers: set[str] = set()
        self.stubborn: set[str] = set()
        self.deaf = 0
        self.heard: list[Any] = []

    def answer(self, frame: bytes) -> list[bytes]:
        message = unpack(frame)
        if not message.get_type().startswith("PARAM"):
            return []
        self.heard.append(message)
        if self.deaf > 0:
            self.deaf -= 1
            return []
        assert (message.target_system, message.target_component) == (1, 1)
        name = message.param_id
        if name not in self.parameters:
            return []
        if message.get_type() == "PARAM_SET" and name not in self.stubborn:
            assert message.param_type == self.kind(name)
            (self.parameters[name],) = self.layout(name).unpack(frame[10:14])
        return [self.told(name)]

    def told(self, name: str) -> bytes:
        value = self.parameters[name]
        raw = self.layout(name).pack(int(value) if name in self.integers else value)
        (carrier,) = struct.unpack("<f", raw)
        return self.pack(
            "PARAM_VALUE", param_id=name.encode(), param_value=carrier, param_type=self.kind(name)
        )

    def kind(self, name: str) -> int:
        return INT32 if name in self.integers else REAL32

    def layout(self, name: str) -> struct.Struct:
        bytewise = name in self.integers and self.autopilot == PX4
        return struct.Struct("<i" if bytewise else "<f")

    def of(self, kind: str) -> list[Any]:
        return [m for m in self.heard if m.get_type() == kind]


class Bench(AnsweredBench):
    """A link to one vehicle that has parameters."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self.vehicle = vehicle
        self.receive(vehicle.heartbeat(autopilot=vehicle.autopilot))

    @property
    def values(self) -> list[ParameterValue]:
        return self.of(ParameterValue)


def read(name: str) -> ReadParameter:
    return ReadParameter(sysid=1, parameter=name)


def write(name: str, value: float) -> WriteParameter:
    return WriteParameter(sysid=1, parameter=name, value=value)


def copter(**parameters: float) -> Bench:
    return Bench(Vehicle(ARDUPILOT, parameters))


def px4(**parameters: int) -> Bench:
    vehicle = Vehicle(PX4, dict(parameters))
    vehicle.integers = set(parameters)
    return Bench(vehicle)


def test_a_value_is_told_with_the_name_the_vehicle_has_for_it() -> None:
    bench = copter(FS_GCS_ENABLE=1.0)
    bench.send(read("FS_GCS_ENABLE"))
    assert bench.values == [
        ParameterValue(
            received_s=50.0,
            sysid=1,
            parameter="FS_GCS_ENABLE",
            value=1.0,
            own_name="FS_GCS_ENABLE",
        )
    ]
    bench.wait(5.0)
    assert (len(bench.values), len(bench.vehicle.heard)) == (1, 1)


@pytest.mark.parametrize(
    ("has", "asked", "value", "unit"),
    [
        ({"MAV_GCS_SYSID": 255.0}, "MAV_GCS_SYSID", 255.0, 1.0),
        ({"SYSID_MYGCS": 255.0}, "MAV_GCS_SYSID", 255.0, 1.0),
        ({"SYSID_THISMAV": 3.0}, "MAV_SYSID", 3.0, 1.0),
        ({"RTL_ALT_M": 15.0}, "RTL_ALT_M", 15.0, 1.0),
        ({"RTL_ALT": 1500.0}, "RTL_ALT_M", 15.0, 0.01),
    ],
)
def test_old_and_new_names_are_the_same_parameter(
    has: dict[str, float], asked: str, value: float, unit: float
) -> None:
    bench = copter(**has)
    bench.send(read(asked))
    (told,) = bench.values
    assert (told.parameter, told.value, told.own_unit) == (asked, value, unit)
    assert [told.own_name] == list(has)


def test_a_parameter_is_written_by_its_old_name_in_its_old_unit() -> None:
    bench = copter(RTL_ALT=1500.0)
    bench.send(write("RTL_ALT_M", 42.0))
    assert bench.vehicle.parameters == {"RTL_ALT": 4200.0}
    assert [told.value for told in bench.values] == [42.0]


def test_an_unknown_name_is_met_with_silence_and_ends_after_four_tries() -> None:
    bench = copter(FS_GCS_ENABLE=1.0)
    bench.send(read("MAV_GCS_SYSID"))
    bench.wait(3.9)
    assert bench.values == []
    bench.wait(0.2)
    (told,) = bench.values
    assert (told.value, told.own_name, told.received_s) == (None, "MAV_GCS_SYSID", 54.0)
    asked = [message.param_id for message in bench.vehicle.heard]
    assert asked == ["MAV_GCS_SYSID", "SYSID_MYGCS"] * 4
    assert {message.param_index for message in bench.vehicle.heard} == {-1}


def test_a_lost_question_is_asked_again() -> None:
    bench = copter(FS_GCS_ENABLE=1.0)
    bench.vehicle.deaf = 2
    bench.send(read("FS_GCS_ENABLE"))
    bench.wait(3.0)
    assert [(told.value, told.received_s) for told in bench.values] == [(1.0, 52.0)]


def test_several_parameters_are_read_at_a_time() -> None:
    bench = copter(A=1.0, C=3.0)
    bench.send(read("A"), read("B"), read("C"))
    bench.wait(5.0)
    assert {told.parameter: told.value for told in bench.values} == {"A": 1.0, "B": None, "C": 3.0}
    assert max(told.received_s for told in bench.values) == 54.0


# -1 is a NaN to whoever takes the bytes for a float; 2139095041 one that a register would alter.
@pytest.mark.parametrize("value", [0, 1, -1, 245, 16_777_217, -(2**31)])
def test_integers_of_px4_travel_as_their_bytes(value: int) -> None:
    bench = px4(COM_OBL_RC_ACT=value)
    bench.send(read("COM_OBL_RC_ACT"))
    assert [told.value for told in bench.values] == [float(value)]


def test_a_bytewise_integer_never_passes_through_a_float() -> None:
    bench = px4(SOME=7)
    raw = struct.pack("<i", 2_139_095_041)  # the bytes of a signalling NaN
    frame = bench.vehicle.told("SOME")
    body = bytearray(frame[1:-2])
    body[9:13] = raw
    checksum = mavlink.x25crc(bytes(body) + bytes((220,))).crc  # PARAM_VALUE's CRC_EXTRA
    bench.vehicle.deaf = 1
    bench.send(read("SOME"))
    bench.receive(b"\xfd" + bytes(body) + struct.pack("<H", checksum))
    assert [told.value for told in bench.values] == [2_139_095_041.0]


def test_an_integer_of_ardupilot_travels_as_a_float_of_its_value() -> None:
    bench = copter(FS_GCS_ENABLE=0.0)
    bench.vehicle.integers = {"FS_GCS_ENABLE"}
    bench.send(write("FS_GCS_ENABLE", 1.0))
    (message,) = bench.vehicle.of("PARAM_SET")
    assert (message.param_value, message.param_type) == (1.0, INT32)
    assert [told.value for told in bench.values] == [1.0]


def test_a_write_to_px4_carries_the_vehicles_own_type() -> None:
    bench = px4(NAV_DLL_ACT=0)
    bench.send(write("NAV_DLL_ACT", 2.0))
    (message,) = bench.vehicle.of("PARAM_SET")
    assert message.param_type == INT32
    assert struct.pack("<f", message.param_value) == b"\2\0\0\0"
    assert bench.vehicle.parameters == {"NAV_DLL_ACT": 2}
    assert [told.value for told in bench.values] == [2.0]


@pytest.mark.parametrize("value", [0.5, math.nan, math.inf, 2.0**31])
def test_what_an_integer_cannot_hold_is_not_written(value: float) -> None:
    bench = px4(NAV_DLL_ACT=1)
    bench.send(write("NAV_DLL_ACT", value))
    assert bench.vehicle.of("PARAM_SET") == []
    assert [told.value for told in bench.values] == [1.0]


def test_what_is_right_already_is_not_written() -> None:
    bench = copter(FS_GCS_ENABLE=1.0)
    bench.send(write("FS_GCS_ENABLE", 1.0))
    assert bench.vehicle.of("PARAM_SET") == []
    assert [told.value for told in bench.values] == [1.0]


def test_a_vehicle_that_keeps_its_value_is_told_four_times_and_its_value_reported() -> None:
    bench = copter(FS_GCS_ENABLE=0.0)
    bench.vehicle.stubborn = {"FS_GCS_ENABLE"}
    bench.send(write("FS_GCS_ENABLE", 1.0))
    bench.wait(5.0)
    assert len(bench.vehicle.of("PARAM_SET")) == 4
    assert [told.value for told in bench.values] == [0.0]


def test_the_old_value_that_arrives_late_is_no_echo() -> None:
    bench = copter(FS_GCS_ENABLE=0.0)
    late = bench.vehicle.told("FS_GCS_ENABLE")
    bench.vehicle.stubborn = {"FS_GCS_ENABLE"}
    bench.send(write("FS_GCS_ENABLE", 1.0))
    bench.receive(late)
    assert bench.values == []
    bench.vehicle.stubborn = set()
    bench.wait(1.5)
    assert [told.value for told in bench.values] == [1.0]


def test_a_later_write_of_a_parameter_ends_the_one_before() -> None:
    bench = copter(FS_GCS_ENABLE=0.0)
    bench.vehicle.stubborn = {"FS_GCS_ENABLE"}
    bench.send(write("FS_GCS_ENABLE", 1.0), write("FS_GCS_ENABLE", 5.0))
    bench.vehicle.stubborn = set()
    bench.wait(5.0)
    assert bench.vehicle.parameters == {"FS_GCS_ENABLE": 5.0}
    assert [told.value for told in bench.values] == [0.0, 5.0]


@pytest.mark.parametrize("name", ["", "SEVENTEEN_LETTERS", "GRÖSSE"])
def test_what_can_be_no_name_is_never_asked_for(name: str) -> None:
    bench = copter()
    bench.send(read(name))
    assert [(told.parameter, told.value) for told in bench.values] == [(name, None)]
    assert bench.vehicle.heard == []


def test_a_vehicle_that_was_never_heard_tells_nothing() -> None:
    bench = copter()
    bench.send(ReadParameter(sysid=9, parameter="A"))
    assert [(told.sysid, told.value) for told in bench.values] == [(9, None)]
