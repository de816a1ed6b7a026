"""The key's file and the timestamp beside it."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from swarmctl.errors import LinkError, UsageError
from swarmctl.link.signing import UNITS_PER_S
from swarmctl.link.signing_key_file import RESERVE_S, STORE_EVERY_S, TimestampFile, read_key

KEY = hashlib.sha256(b"correct horse").digest()


@pytest.mark.parametrize(
    "content",
    [
        KEY,
        KEY.hex().encode(),
        KEY.hex().upper().encode() + b"\n",
        b"correct horse",
        b"correct horse\r\n",
    ],
    ids=["raw", "hex", "hex line", "passphrase", "passphrase line"],
)
def test_every_form_of_a_key(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "key"
    path.write_bytes(content)
    assert read_key(path) == KEY


def test_a_passphrase_of_32_letters_is_a_passphrase(tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_bytes(b"a" * 32)
    assert read_key(path) == hashlib.sha256(b"a" * 32).digest()


@pytest.mark.parametrize("content", [b"", b"\n", b"\xff\x00" * 15, b"one\ntwo\n"], ids=repr)
def test_a_file_without_a_key_is_bad_input(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "key"
    path.write_bytes(content)
    with pytest.raises(UsageError, match="32 bytes, 64 hexadecimal digits, or a passphrase"):
        read_key(path)


def test_a_file_that_is_not_there_is_bad_input(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"cannot be read \(No such file"):
        read_key(tmp_path / "key")


def test_a_restart_goes_on_behind_everything_that_was_used(tmp_path: Path) -> None:
    assert TimestampFile(tmp_path / "key").load() == 0
    TimestampFile(tmp_path / "key").store(1000)
    # Whatever is signed before the next storing stays below what a restart begins with.
    assert TimestampFile(tmp_path / "key").load() > 1000 + 2.0 * STORE_EVERY_S * UNITS_PER_S
    assert TimestampFile(tmp_path / "key").load() == 1000 + RESERVE_S * UNITS_PER_S
    assert [path.name for path in tmp_path.iterdir()] == ["key.timestamp"]


def test_a_timestamp_that_cannot_be_read_or_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "key.timestamp").write_text("yesterday")
    with pytest.raises(LinkError, match="whole number"):
        TimestampFile(tmp_path / "key").load()
    with pytest.raises(LinkError, match="make the directory writable"):
        TimestampFile(tmp_path / "nowhere" / "key").store(1)
