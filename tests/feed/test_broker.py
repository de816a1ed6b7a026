"""The embedded broker: where it listens, and that it is quiet and leaves nothing behind."""

from __future__ import annotations

import asyncio
import logging

import pytest

from swarmctl.errors import FeedError, UsageError
from swarmctl.feed.broker import embedded_broker
from swarmctl.feed.client import connect

pytestmark = pytest.mark.live


async def test_port_0_is_a_free_port_and_gone_afterwards() -> None:
    async with embedded_broker(port=0) as address:
        assert address.host == "127.0.0.1"
        assert address.port > 0
        async with connect(address) as client:
            assert await client.publish("a", b"b")
    with pytest.raises(FeedError):
        await connect(address).__aenter__()


async def test_a_port_in_use_is_named() -> None:
    async with embedded_broker(port=0) as address:
        with pytest.raises(FeedError) as caught:
            await embedded_broker(port=address.port).__aenter__()
    assert str(caught.value) == (
        f"The embedded MQTT broker cannot listen on {address} (Address already in use): "
        "stop what uses that port or choose another."
    )


@pytest.mark.parametrize("host", ["0.0.0.0", "192.0.2.1", "example.org", "::"])
async def test_it_serves_loopback_only(host: str) -> None:
    with pytest.raises(UsageError, match="loopback only"):
        await embedded_broker(host).__aenter__()


async def test_it_leaves_nothing_running() -> None:
    before = asyncio.all_tasks()
    async with embedded_broker(port=0) as address, connect(address, topics=["a"]):
        _, silent = await asyncio.open_connection(address.host, address.port)
    silent.close()
    await silent.wait_closed()
    assert asyncio.all_tasks() == before


async def test_it_says_nothing_on_the_console(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    async with embedded_broker(port=0) as address:
        _, writer = await asyncio.open_connection(address.host, address.port)
        writer.write(b"this is not MQTT")
        writer.close()
        await writer.wait_closed()
        async with connect(address, topics=["a"]) as client:
            assert await client.publish("a", b"b")
    assert [record.name for record in caplog.records if record.name != "asyncio"] == []
