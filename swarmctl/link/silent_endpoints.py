"""Endpoints on which nothing is heard after their opening."""

from __future__ import annotations

from collections.abc import Sequence

SILENT_LINK_S = 10.0
"""An endpoint on which nothing sound was heard this long after its opening is named, s."""


class SilentEndpoints:
    """Watches newly opened endpoints for silence."""

    def __init__(self) -> None:
        # URL of each endpoint that was not heard yet, and when to name it.
        self._unheard: dict[int, tuple[str, float]] = {}

    def listen(self, urls: Sequence[str], now: float) -> None:
        """Watch endpoints, numbered by the place of their URLs."""
        self._unheard = {i: (url, now + SILENT_LINK_S) for i, url in enumerate(urls)}

    def heard(self, endpoint: int) -> None:
        """Something sound came in by an endpoint."""
        if self._unheard:
            self._unheard.pop(endpoint, None)

    def overdue(self, now: float) -> list[str]:
        """URLs of the endpoints that were silent for too long, each once."""
        late = [i for i, (_, deadline_s) in self._unheard.items() if now >= deadline_s]
        return [self._unheard.pop(i)[0] for i in late]
