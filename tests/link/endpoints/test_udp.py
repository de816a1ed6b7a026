"""UDP endpoints on real loopback sockets."""

from __future__ import annotations

import asyncio
import socket

import pytest

from swarmctl.errors import LinkError
from swarmctl.link.address import Address
from swarmctl.link.endpoints.udp import UdpEndpoint, open_udp
from swarmctl.link.endpoints.url import EndpointUrl
from tests.link.endpoints.loopback import LOOPBACK, Inbox, ignore

pytestmark = pytest.mark.live


def at(endpoint: UdpEndpoint, number: int) -> Address:
    return Address(*endpoint.address, number)


async def test_datagrams_come_in_with_their_sender_and_go_out_to_it() -> None:
    inbox, answers = Inbox(), Inbox()
    ours = await open_udp(LOOPBACK, 3, inbox.put)
    vehicle = await open_udp(LOOPBACK, 0, answers.put)
    try:
        vehicle.send(b"hello", at(ours, 0))
        data, address = await inbox.get()
        assert (data, address) == (b"hello", at(vehicle, 3))
        ours.send(b"and you", address)
        assert await answers.get() == (b"and you", at(ours, 0))
    finally:
        ours.close()
        vehicle.close()


async def test_udpout_speaks_first_and_hears_the_answer_under_its_own_address() -> None:
    inbox, answers = Inbox(), Inbox()
    listener = await open_udp(LOOPBACK, 0, inbox.put)
    host, port = listener.address
    caller = await open_udp(EndpointUrl("udpout", host, port), 2, answers.put)
    try:
        assert caller.remote == Address(host, port, 2)
        caller.send(b"hello", caller.remote)
        data, address = await inbox.get()
        assert data == b"hello"
        listener.send(b"and you", address)
        assert await answers.get() == (b"and you", caller.remote)
    finally:
        caller.close()
        listener.close()


async def test_a_datagram_to_nobody_is_lost_quietly() -> None:
    inbox = Inbox()
    endpoint = await open_udp(LOOPBACK, 0, inbox.put)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as nobody:
        nobody.bind(("127.0.0.1", 0))
        gone = Address(*nobody.getsockname())
    caller = await open_udp(EndpointUrl("udpout", gone.host, gone.port), 0, inbox.put)
    try:
        for _ in range(2):
            endpoint.send(b"anybody there?", gone)
            caller.send(b"anybody there?", gone)
        endpoint.send(b"to myself", at(endpoint, 0))
        assert (await inbox.get())[0] == b"to myself"
    finally:
        endpoint.close()
        caller.close()


async def test_a_port_in_use_is_named_with_what_to_do() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        with pytest.raises(LinkError) as caught:
            await open_udp(EndpointUrl("udpin", "127.0.0.1", port), 0, ignore)
    assert str(caught.value) == (
        f"UDP port {port} on 127.0.0.1 is in use: another ground station or swarmctl listens "
        f"there; stop it, or change swarm.link in the mission file."
    )
    assert caught.value.exit_code == 3


async def test_an_address_of_another_computer_cannot_be_opened() -> None:
    # 192.0.2.0/24 is set aside for documentation (RFC 5737): nobody has it.
    with pytest.raises(LinkError) as caught:
        await open_udp(EndpointUrl("udpin", "192.0.2.1", 14550), 0, ignore)
    assert str(caught.value).startswith("udpin://192.0.2.1:14550 cannot be opened")
    assert "use an address of this computer" in str(caught.value)


async def test_a_closed_port_is_free_again() -> None:
    endpoint = await open_udp(LOOPBACK, 0, ignore)
    host, port = endpoint.address
    endpoint.close()
    await asyncio.sleep(0)
    again = await open_udp(EndpointUrl("udpin", host, port), 0, ignore)
    again.close()
