"""The UDP endpoint on real loopback sockets."""

from __future__ import annotations

import asyncio
import socket

import pytest

from swarmctl.errors import LinkError
from swarmctl.link.endpoint import open_udp, parse_url


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("udpin://0.0.0.0:14550", ("0.0.0.0", 14550)),
        ("udpin://localhost:1", ("localhost", 1)),
        ("udpin://[::1]:14550", ("::1", 14550)),
    ],
)
def test_parse_url(url: str, expected: tuple[str, int]) -> None:
    assert parse_url(url) == expected


@pytest.mark.parametrize(
    "url",
    [
        "tcp://127.0.0.1:5760",
        "serial:///dev/ttyUSB0:57600",
        "udpout://10.0.0.1:14550",
        "udpin://0.0.0.0",
        "udpin://:14550",
        "udpin://0.0.0.0:99999",
        "udpin://0.0.0.0:port",
        "udpin://[::1:14550",
        "udpin://0.0.0.0:14550/path",
        "0.0.0.0:14550",
        "",
    ],
)
def test_any_other_url_is_answered_with_what_is_supported(url: str) -> None:
    with pytest.raises(LinkError) as caught:
        parse_url(url)
    assert repr(url) in str(caught.value)
    assert "only udpin://host:port is supported" in str(caught.value)
    assert "udpin://0.0.0.0:14550" in str(caught.value)


async def test_datagrams_come_in_with_their_sender_and_go_out_to_it() -> None:
    received: asyncio.Queue[tuple[bytes, tuple[str, int]]] = asyncio.Queue()
    ours = await open_udp(
        "udpin://127.0.0.1:0", lambda data, address: received.put_nowait((data, address))
    )
    answers: asyncio.Queue[tuple[bytes, tuple[str, int]]] = asyncio.Queue()
    vehicle = await open_udp(
        "udpin://127.0.0.1:0", lambda data, address: answers.put_nowait((data, address))
    )
    try:
        vehicle.send(b"hello", ours.address)
        async with asyncio.timeout(5.0):
            data, address = await received.get()
        assert (data, address) == (b"hello", vehicle.address)
        ours.send(b"and you", address)
        async with asyncio.timeout(5.0):
            assert await answers.get() == (b"and you", ours.address)
    finally:
        ours.close()
        vehicle.close()


async def test_a_datagram_to_nobody_is_lost_quietly() -> None:
    received: asyncio.Queue[bytes] = asyncio.Queue()
    endpoint = await open_udp("udpin://127.0.0.1:0", lambda data, _: received.put_nowait(data))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as nobody:
        nobody.bind(("127.0.0.1", 0))
        gone = nobody.getsockname()
    try:
        endpoint.send(b"anybody there?", gone)
        endpoint.send(b"to myself", endpoint.address)
        async with asyncio.timeout(5.0):
            assert await received.get() == b"to myself"
    finally:
        endpoint.close()


async def test_a_port_in_use_is_named_with_what_to_do() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        with pytest.raises(LinkError) as caught:
            await open_udp(f"udpin://127.0.0.1:{port}", lambda _data, _address: None)
    assert str(caught.value) == (
        f"UDP port {port} on 127.0.0.1 is in use: another ground station or swarmctl listens "
        f"there; stop it, or change swarm.link in the mission file."
    )


async def test_an_address_of_another_computer_cannot_be_opened() -> None:
    # 192.0.2.0/24 is set aside for documentation (RFC 5737): nobody has it.
    with pytest.raises(LinkError) as caught:
        await open_udp("udpin://192.0.2.1:14550", lambda _data, _address: None)
    assert "'udpin://192.0.2.1:14550'" in str(caught.value)
    assert "use an address of this computer" in str(caught.value)


async def test_a_closed_port_is_free_again() -> None:
    endpoint = await open_udp("udpin://127.0.0.1:0", lambda _data, _address: None)
    host, port = endpoint.address
    endpoint.close()
    await asyncio.sleep(0)
    again = await open_udp(f"udpin://{host}:{port}", lambda _data, _address: None)
    again.close()
