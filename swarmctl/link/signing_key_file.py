"""The signing key on disk, and beside it the next timestamp to sign with."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from swarmctl.errors import LinkError, UsageError
from swarmctl.link.signing import UNITS_PER_S

RESERVE_S = 60.0
"""The stored timestamp is this far ahead of the one used, so that it is stored rarely, s."""
STORE_EVERY_S = 15.0
"""How often the timestamp is to be stored, s."""
_KEY_BYTES = 32


def read_key(path: Path) -> bytes:
    """The 32-byte key of a file.

    The file holds 32 bytes that are not text, or 64 hexadecimal digits, or a passphrase, whose
    SHA-256 is the key, as in MAVProxy's ``signing setup`` and in QGroundControl. Space around
    the text is ignored.

    Raises:
        UsageError: If the file cannot be read or holds none of these.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UsageError(
            f"swarm.signing_key_file is {str(path)!r}, which cannot be read ({error.strerror})."
        ) from error
    try:
        text = data.decode("utf-8").strip()
    except UnicodeDecodeError:
        text = ""
    is_text = bool(text) and text.isprintable()
    if len(data) == _KEY_BYTES and not is_text:
        return data
    if re.fullmatch(r"[0-9A-Fa-f]{64}", text):
        return bytes.fromhex(text)
    if is_text:
        return hashlib.sha256(text.encode("utf-8")).digest()
    raise UsageError(
        f"swarm.signing_key_file is {str(path)!r}, which holds no key: it should hold 32 bytes, "
        f"64 hexadecimal digits, or a passphrase in one line."
    )


class TimestampFile:
    """Keeps our timestamp across restarts, in the key file's name with ``.timestamp`` added.

    The stored timestamp is ``RESERVE_S`` ahead of the one used: a start after a crash uses no
    timestamp twice, and vehicles still trust a computer whose clock was set back.

    Args:
        key_path: The key's file.
    """

    def __init__(self, key_path: Path) -> None:
        self._path = key_path.with_name(key_path.name + ".timestamp")

    def load(self) -> int:
        """The first timestamp that may be used; 0 if none was stored.

        Raises:
            LinkError: If the file cannot be read or holds no timestamp.
        """
        try:
            return int(self._path.read_text(encoding="ascii"))
        except FileNotFoundError:
            return 0
        except (OSError, ValueError) as error:
            raise LinkError(
                f"{self._path} should hold the timestamp that signing goes on from, a whole "
                f"number, but cannot be read ({error}). Delete it if this computer's clock is "
                f"right."
            ) from error

    def store(self, timestamp: int) -> None:
        """Store a used timestamp, with the reserve added.

        Raises:
            LinkError: If the file cannot be written.
        """
        reserved = timestamp + int(RESERVE_S * UNITS_PER_S)
        fresh = self._path.with_name(self._path.name + ".new")
        try:
            fresh.write_text(f"{reserved}\n", encoding="ascii")
            fresh.replace(self._path)
        except OSError as error:
            raise LinkError(
                f"{self._path} cannot be written ({error.strerror}): signing keeps its timestamp "
                f"there, beside the key; make the directory writable."
            ) from error
