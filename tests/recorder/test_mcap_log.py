"""The MCAP log, read back by mcap's own reader, every message against its schema."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest
from mcap.reader import make_reader

from swarmctl.decisions import EstimateMade
from swarmctl.events import InputRejected, OperatorRequest, Record
from swarmctl.recorder.mcap_log import McapLog, name_of, topic_of, viewer_schema
from tests.recorder.samples import ONE_OF_EACH, again, record_types

UTC_S = 1_790_000_000.25


def write(path: Path, records: tuple[Record, ...]) -> None:
    log = McapLog(
        path,
        mission_name="beacon.yaml",
        mission_text="name: beacon\n# Grüße\n",
        provenance={"seed": 7, "commit": "abc", "versions": {"numpy": "2.4"}},
    )
    for k, record in enumerate(records):
        log.write(record, UTC_S + k)
    log.close()


def fault(value: Any, schema: dict[str, Any]) -> str | None:  # noqa: ANN401 (JSON is anything)
    """What is wrong with a value by the part of JSON Schema that MCAP viewers understand.

    Anything outside of that part is a fault of the schema.
    """
    if value is None:
        return None if schema.get("nullable") else "null"
    match schema:
        case {"$ref": _} | {"anyOf": _} | {"oneOf": _} | {"prefixItems": _}:
            return f"viewers do not understand {schema}"
        case {"type": "boolean"}:
            return None if isinstance(value, bool) else f"{value!r} is no boolean"
        case {"type": "integer"}:
            return None if isinstance(value, int) else f"{value!r} is no integer"
        case {"type": "number"}:
            return None if isinstance(value, int | float) else f"{value!r} is no number"
        case {"type": "string"}:
            good = isinstance(value, str) and value in schema.get("enum", [value])
            return None if good else f"{value!r} is not of {schema}"
        case {"type": "array", "items": items}:
            if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", 1e9):
                return f"{value!r} has not {schema} items"
            return next((f for item in value if (f := fault(item, items))), None)
        case {"type": "object", "properties": properties}:
            if value.keys() != set(schema["required"]) or value.keys() != properties.keys():
                return f"{sorted(value)} are not {sorted(properties)}"
            return next((f for k, v in value.items() if (f := fault(v, properties[k]))), None)
    return f"viewers do not understand {schema}"


def test_the_samples_have_one_of_each_kind() -> None:
    assert {type(record) for record in ONE_OF_EACH} == set(record_types(Record))


def test_everything_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "mission.mcap"
    write(path, ONE_OF_EACH)
    with path.open("rb") as stream:
        read = list(make_reader(stream).iter_messages())
    assert [m.log_time for _, _, m in read] == [
        round((UTC_S + k) * 1e9) for k in range(len(ONE_OF_EACH))
    ]
    for record, (schema, channel, message) in zip(ONE_OF_EACH, read, strict=True):
        assert schema is not None
        assert (schema.name, schema.encoding) == (json.loads(message.data)["type"], "jsonschema")
        assert (channel.topic, channel.message_encoding) == (topic_of(record), "json")
        assert message.publish_time == message.log_time
        assert fault(json.loads(message.data), json.loads(schema.data)) is None
        assert msgspec.json.decode(message.data, type=type(record)) == again(record) == record


def test_the_mission_and_where_it_came_from_are_inside(tmp_path: Path) -> None:
    path = tmp_path / "mission.mcap"
    write(path, ())
    with path.open("rb") as stream:
        reader = make_reader(stream)
        (attachment,) = reader.iter_attachments()
        (metadata,) = reader.iter_metadata()
    assert (attachment.name, attachment.media_type) == ("beacon.yaml", "application/yaml")
    assert attachment.data.decode() == "name: beacon\n# Grüße\n"
    assert metadata.name == "provenance"
    assert metadata.metadata == {"seed": "7", "commit": "abc", "versions": '{"numpy":"2.4"}'}


def test_each_vehicle_has_its_channel_and_each_kind_one_schema(tmp_path: Path) -> None:
    path = tmp_path / "mission.mcap"
    beats = tuple(msgspec.structs.replace(ONE_OF_EACH[0], sysid=sysid) for sysid in (1, 2, 1, 2))
    write(path, beats)
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert sorted(c.topic for c in summary.channels.values()) == [
        "/vehicle/1/Heartbeat",
        "/vehicle/2/Heartbeat",
    ]
    assert [s.name for s in summary.schemas.values()] == ["Heartbeat"]
    assert sorted(summary.statistics.channel_message_counts.values()) == [2, 2]


def test_the_same_records_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write(tmp_path / name, ONE_OF_EACH)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@pytest.mark.parametrize(
    ("kind", "topic"),
    [
        ("VehiclePosition", "/vehicle/3/VehiclePosition"),
        ("RangeDifferences", "/feed/RangeDifferences"),
        ("ArrivalTime", "/feed/ArrivalTime"),
        ("FeedConnection", "/feed/FeedConnection"),
        ("EmitterTruth", "/truth/EmitterTruth"),
        ("ReceiverTruth", "/truth/ReceiverTruth"),
        ("OperatorRequest", "/operator/OperatorRequest"),
        ("InputRejected", "/input/InputRejected"),
        ("Estimate", "/decision/Estimate"),
        ("ReceiverEstimate", "/decision/ReceiverEstimate"),
        ("GoTo", "/command/GoTo/3"),
    ],
)
def test_a_topic_tells_the_family(kind: str, topic: str) -> None:
    (record,) = [r for r in ONE_OF_EACH if name_of(type(r)) == kind]
    assert topic_of(record) == topic


def test_a_schema_is_one_object_without_references() -> None:
    schema = viewer_schema(InputRejected)
    assert schema["type"] == "object"
    assert schema["properties"]["source"] == {"type": "string", "enum": ["feed", "mavlink"]}
    assert "$defs" not in schema
    assert viewer_schema(OperatorRequest)["title"] == "OperatorRequest"
    assert viewer_schema(EstimateMade)["title"] == "Estimate"
