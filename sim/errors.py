"""The one exception the simulator raises on purpose."""

from __future__ import annotations


class SimError(Exception):
    """A simulation cannot be set up or served; the message is one sentence for a person."""
