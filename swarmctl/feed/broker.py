"""The embedded MQTT broker (amqtt): no set-up for simulations and for a single machine."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import logging
import os
from collections.abc import AsyncIterator

from amqtt.adapters import StreamReaderAdapter, StreamWriterAdapter
from amqtt.broker import Broker
from amqtt.contexts import BrokerConfig, ListenerConfig, ListenerType

from swarmctl.errors import FeedError, UsageError
from swarmctl.feed.client import BrokerAddress

_LISTENER = "default"


@contextlib.asynccontextmanager
async def embedded_broker(
    host: str = "127.0.0.1", port: int = 1883
) -> AsyncIterator[BrokerAddress]:
    """Run a broker in this event loop.

    It asks for no password, so it serves the loopback interface only.

    Args:
        host: Loopback address to listen on.
        port: TCP port; 0 takes a free one.

    Yields:
        The address it listens on.

    Raises:
        UsageError: If ``host`` is not a loopback address.
        FeedError: If the port cannot be listened on.
    """
    if not _is_loopback(host):
        msg = (
            f"The embedded MQTT broker asks for no password and listens on loopback only, not on "
            f"{host!r}: use 127.0.0.1, or run a broker such as mosquitto there."
        )
        raise UsageError(msg)
    # The operator's console does not report what clients do wrong.
    for library in ("amqtt", "transitions"):
        logging.getLogger(library).setLevel(logging.CRITICAL)
    broker = Broker(
        BrokerConfig(
            # With an external listener the socket is ours: a port in use is a plain OSError,
            # and the number of port 0 can be read.
            listeners={_LISTENER: ListenerConfig(type=ListenerType.EXTERNAL)},
            plugins={"amqtt.plugins.authentication.AnonymousAuthPlugin": {}},
        )
    )

    connections: set[asyncio.Task[None]] = set()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        connections.add(task)
        try:
            await broker.external_connected(
                StreamReaderAdapter(reader), StreamWriterAdapter(writer), _LISTENER
            )
        finally:
            # amqtt leaves connections open that did not begin with a CONNECT.
            writer.close()
            connections.discard(task)

    await broker.start()
    try:
        try:
            server = await asyncio.start_server(serve, host, port)
        except OSError as error:
            reason = os.strerror(error.errno or 0)
            msg = (
                f"The embedded MQTT broker cannot listen on {host}:{port} ({reason}): "
                "stop what uses that port or choose another."
            )
            raise FeedError(msg) from error
        try:
            yield BrokerAddress(host, server.sockets[0].getsockname()[1])
        finally:
            server.close()
    finally:
        await broker.shutdown()
        # Clients that connected and never spoke have no session that could be shut down.
        for task in connections:
            task.cancel()
        await asyncio.gather(*connections, return_exceptions=True)


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
