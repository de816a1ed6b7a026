"""The URLs of MAVLink endpoints."""

from __future__ import annotations

import pytest

from swarmctl.errors import UsageError
from swarmctl.link.endpoints.url import EndpointUrl, parse_url


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("udpin://0.0.0.0:14550", EndpointUrl("udpin", "0.0.0.0", 14550)),
        ("udpin://localhost:0", EndpointUrl("udpin", "localhost", 0)),
        ("udpin://[::1]:14550", EndpointUrl("udpin", "::1", 14550)),
        ("udpout://10.0.0.1:14550", EndpointUrl("udpout", "10.0.0.1", 14550)),
        ("tcp://127.0.0.1:5760", EndpointUrl("tcp", "127.0.0.1", 5760)),
        ("serial:///dev/ttyUSB0:57600", EndpointUrl("serial", "/dev/ttyUSB0", 57600)),
        (
            "serial:///dev/serial/by-id/usb-3D_Radio-if00:921600",
            EndpointUrl("serial", "/dev/serial/by-id/usb-3D_Radio-if00", 921600),
        ),
    ],
)
def test_what_a_url_means_and_its_text(url: str, expected: EndpointUrl) -> None:
    assert parse_url(url) == expected
    assert str(expected) == url


@pytest.mark.parametrize(
    "url",
    [
        "http://127.0.0.1:80",
        "udp://127.0.0.1:14550",
        "tcp://127.0.0.1:0",
        "udpout://127.0.0.1",
        "udpin://0.0.0.0",
        "udpin://:14550",
        "udpin://0.0.0.0:99999",
        "udpin://0.0.0.0:port",
        "udpin://[::1:14550",
        "udpin://0.0.0.0:14550/path",
        "serial:///dev/ttyUSB0",
        "serial:///dev/ttyUSB0:0",
        "serial:///dev/ttyUSB0:fast",
        "serial://ttyUSB0:57600",
        "0.0.0.0:14550",
        "",
    ],
)
def test_any_other_url_is_bad_input_answered_with_what_there_is(url: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse_url(url)
    assert repr(url) in str(caught.value)
    assert "udpin://host:port (listens for vehicles, as in udpin://0.0.0.0:14550)" in str(
        caught.value
    )
    assert "serial:///dev/name:baud" in str(caught.value)
