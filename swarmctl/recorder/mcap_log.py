"""The MCAP log: every record the core saw or made, as JSON with its schema.

There is one channel per topic (:func:`topic_of`). Schemas and messages are encoded as
``jsonschema`` and ``json`` of the MCAP registry. Viewers such as Foxglove and Lichtblick
understand only a part of JSON Schema; :func:`viewer_schema` rewrites msgspec's schemas in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
from mcap.writer import CompressionType, Writer

import swarmctl
from swarmctl.commands import Command
from swarmctl.decisions import Decision
from swarmctl.events import (
    ArrivalTime,
    EmitterTruth,
    FeedConnection,
    OperatorRequest,
    RangeDifferences,
    ReceiverTruth,
    Record,
    VehicleObservation,
)

_OBSERVATION_FAMILIES: dict[type[Record], str] = {
    RangeDifferences: "feed",
    ArrivalTime: "feed",
    FeedConnection: "feed",
    EmitterTruth: "truth",
    ReceiverTruth: "truth",
    OperatorRequest: "operator",
}
_OTHER_OBSERVATIONS = "input"


def name_of(kind: type[Record]) -> str:
    """The name of a record class in a recording: its tag, the ``type`` of its JSON."""
    return str(kind.__struct_config__.tag)


def topic_of(record: Record) -> str:
    """The topic of a record: its family, name and vehicle.

    ``/vehicle/3/VehiclePosition``, ``/feed/RangeDifferences``, ``/truth/EmitterTruth``,
    ``/operator/OperatorRequest``, ``/input/InputRejected``, ``/decision/Estimate``,
    ``/command/GoTo/3``.
    """
    kind = type(record)
    name = name_of(kind)
    match record:
        case VehicleObservation():
            return f"/vehicle/{record.sysid}/{name}"
        case Command():
            return f"/command/{name}/{record.sysid}"
        case Decision():
            return f"/decision/{name}"
        case _:
            return f"/{_OBSERVATION_FAMILIES.get(kind, _OTHER_OBSERVATIONS)}/{name}"


def viewer_schema(kind: type[Record]) -> dict[str, Any]:
    """JSON Schema of a record class, in the part of JSON Schema that MCAP viewers understand.

    References are inlined, an array has one schema for all its items, and an enumeration has
    the type string. A value that may be null has its other schema, marked ``nullable``
    (OpenAPI's keyword): viewers know neither ``anyOf`` nor the type ``null``. Every property is
    required, because fields with their default are written as well.
    """
    schema = msgspec.json.schema(kind)
    narrowed: dict[str, Any] = _narrow(schema, schema["$defs"])
    narrowed["title"] = name_of(kind)
    return narrowed


def _narrow(schema: Any, definitions: Mapping[str, Any]) -> Any:  # noqa: ANN401 (JSON is anything)
    if isinstance(schema, list):
        return [_narrow(item, definitions) for item in schema]
    if not isinstance(schema, dict):
        return schema
    if "$ref" in schema:
        return _narrow(definitions[schema["$ref"].rpartition("/")[2]], definitions)
    if "anyOf" in schema:
        (value,) = [s for s in schema["anyOf"] if s != {"type": "null"}]
        return {**_narrow(value, definitions), "nullable": True}
    if "prefixItems" in schema:
        item, *others = schema["prefixItems"]
        assert all(other == item for other in others), "a tuple of one type"
        schema = {k: v for k, v in schema.items() if k != "prefixItems"} | {"items": item}
    if "properties" in schema:
        schema = {**schema, "required": list(schema["properties"])}
    if "enum" in schema:
        schema = {"type": "string", **schema}
    return {key: _narrow(value, definitions) for key, value in schema.items()}


class McapLog:
    """Writes an MCAP file.

    Args:
        path: File to create.
        mission_name: File name of the mission, for the attachment.
        mission_text: The mission file's text, attached.
        provenance: Written as the metadata record ``provenance``; values that are not text
            are written as JSON.
    """

    def __init__(
        self,
        path: Path,
        *,
        mission_name: str,
        mission_text: str,
        provenance: Mapping[str, object],
    ) -> None:
        self._file = path.open("wb")
        # Measured on vehicle positions: Zstandard costs no more time than no compression
        # and leaves a quarter of the bytes.
        self._writer = Writer(self._file, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library=f"swarmctl {swarmctl.__version__}")
        self._writer.add_metadata(
            "provenance",
            {
                key: value if isinstance(value, str) else msgspec.json.encode(value).decode()
                for key, value in provenance.items()
            },
        )
        # The mission was there before any time was: the format's value for that is 0.
        self._writer.add_attachment(
            create_time=0,
            log_time=0,
            name=mission_name,
            media_type="application/yaml",
            data=mission_text.encode(),
        )
        self._encode = msgspec.json.Encoder().encode
        self._channels: dict[tuple[type[Record], int], int] = {}
        self._schemas: dict[type[Record], int] = {}

    def write(self, record: Record, utc_s: float) -> None:
        """Append a record that was made or arrived at ``utc_s`` (UTC, s)."""
        key = (type(record), getattr(record, "sysid", 0))
        channel = self._channels.get(key)
        if channel is None:
            channel = self._channels[key] = self._register(record)
        time_ns = round(utc_s * 1e9)
        self._writer.add_message(
            channel_id=channel, log_time=time_ns, data=self._encode(record), publish_time=time_ns
        )

    def close(self) -> None:
        """Write the index and finish the file."""
        self._writer.finish()  # type: ignore[no-untyped-call]  # mcap left this one out
        self._file.close()

    def _register(self, record: Record) -> int:
        kind = type(record)
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(
                name=name_of(kind),
                encoding="jsonschema",
                data=msgspec.json.encode(viewer_schema(kind)),
            )
        return self._writer.register_channel(
            topic=topic_of(record), message_encoding="json", schema_id=self._schemas[kind]
        )
