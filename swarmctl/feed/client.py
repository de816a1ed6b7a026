"""The MQTT client: subscribes, delivers, publishes, and reconnects to a lost broker."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import socket
import ssl
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from dataclasses import dataclass, field
from urllib.parse import unquote, urlsplit

import aiomqtt
from aiomqtt.exceptions import MqttConnectError

from swarmctl.errors import FeedError, UsageError

_DEFAULT_PORTS = {"mqtt": 1883, "mqtts": 8883}
_KEEPALIVE_S = 5
"""A broker that dies without closing its connection is noticed within twice this, s."""
_CONNECT_TIMEOUT_S = 5.0
_PUBLISH_TIMEOUT_S = 0.5
_SUBACK_FAILURE = 0x80
"""Return codes from here on refuse a subscription (MQTT 3.1.1, section 3.9.3)."""
# paho leaves Nagle's algorithm on, which holds back small messages until the last one is
# acknowledged: up to 40 ms.
_NO_DELAY = (socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

# on_state and FeedError say what paho would log.
_quiet = logging.getLogger("swarmctl.feed.paho")
_quiet.setLevel(logging.CRITICAL)


@dataclass(frozen=True)
class BrokerAddress:
    """Where an MQTT broker listens.

    Attributes:
        host: Host name or IP address.
        port: TCP port.
        tls: Whether to speak TLS, trusting what the system trusts.
        username: User name; None for an anonymous client.
        password: Password; None for none.
    """

    host: str
    port: int
    tls: bool = False
    username: str | None = None
    password: str | None = field(default=None, repr=False)

    @classmethod
    def parse(cls, url: str) -> BrokerAddress:
        """Read ``mqtt://[user[:password]@]host[:port]``, or ``mqtts://`` for TLS.

        The port defaults to 1883, with TLS to 8883; user and password may be
        percent-encoded.

        Raises:
            UsageError: If it is not such an address.
        """
        try:
            parts = urlsplit(url)
            port = _DEFAULT_PORTS[parts.scheme] if parts.port is None else parts.port
        except (KeyError, ValueError):
            parts, port = urlsplit(""), 0
        if (
            not parts.hostname
            or not port
            or parts.path not in {"", "/"}
            or parts.query
            or parts.fragment
        ):
            # The text may hold a password: what precedes the @ is not repeated.
            msg = (
                f"{url.rpartition('@')[2]!r} is not the address of an MQTT broker: "
                "write mqtt://[user[:password]@]host[:port], or mqtts:// for TLS."
            )
            raise UsageError(msg)
        return cls(
            host=parts.hostname,
            port=port,
            tls=parts.scheme == "mqtts",
            username=None if parts.username is None else unquote(parts.username),
            password=None if parts.password is None else unquote(parts.password),
        )

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{host}:{self.port}"


class FeedClient:
    """A connection to a broker; made by :func:`connect`."""

    _client: aiomqtt.Client

    def __init__(
        self,
        address: BrokerAddress,
        topics: Sequence[str],
        on_message: Callable[[str, bytes], None],
        on_state: Callable[[bool], None],
    ) -> None:
        self._address = address
        self._topics = topics
        self._on_message = on_message
        self._on_state = on_state
        self._tls = ssl.create_default_context() if address.tls else None

    async def publish(self, topic: str, payload: bytes) -> bool:
        """Publish once, without acknowledgement (QoS 0).

        Returns:
            Whether it was sent. False while the broker is away, and after half a second of a
            stalled connection: a later estimate is useless.
        """
        try:
            await self._client.publish(topic, payload, timeout=_PUBLISH_TIMEOUT_S)
        except aiomqtt.MqttError:
            return False
        return True

    async def _keep(self) -> None:
        """Deliver messages for ever, by this connection and by those that follow it."""
        while True:
            try:
                async for message in self._client.messages:
                    self._on_message(message.topic.value, message.payload)
            except aiomqtt.MqttError:
                self._on_state(False)
            await self._reopen()
            self._on_state(True)

    async def _reopen(self) -> None:
        for wait_s in back_off_s():
            await asyncio.sleep(wait_s)
            with contextlib.suppress(FeedError):
                await self._open()
                return

    async def _open(self) -> None:
        """Connect and subscribe.

        Raises:
            FeedError: With one sentence for the operator.
        """
        client = aiomqtt.Client(
            self._address.host,
            self._address.port,
            username=self._address.username,
            password=self._address.password,
            tls_context=self._tls,
            keepalive=_KEEPALIVE_S,
            timeout=_CONNECT_TIMEOUT_S,
            socket_options=[_NO_DELAY],
            logger=_quiet,
        )
        try:
            await _enter(client)
        except MqttConnectError as error:
            msg = (
                f"The MQTT broker at {self._address} refuses the connection ({error.rc}): "
                "check the user name and password in its address."
            )
            raise FeedError(msg) from error
        except aiomqtt.MqttError as error:
            hint = (
                "check that it serves TLS there with a certificate this system trusts"
                if self._tls
                else "start one there or correct the address"
            )
            msg = f"No MQTT broker can be reached at {self._address} ({error}): {hint}."
            raise FeedError(msg) from error
        try:
            await self._subscribe(client)
        except BaseException:
            await _close(client)
            raise
        self._client = client

    async def _subscribe(self, client: aiomqtt.Client) -> None:
        if not self._topics:
            return
        try:
            codes = await client.subscribe([(topic, 0) for topic in self._topics])
        except aiomqtt.MqttError as error:
            msg = f"The MQTT broker at {self._address} was lost while subscribing ({error})."
            raise FeedError(msg) from error
        values = [code if isinstance(code, int) else code.value for code in codes]
        for topic, value in zip(self._topics, values, strict=True):
            if value >= _SUBACK_FAILURE:
                msg = (
                    f"The MQTT broker at {self._address} refuses a subscription to {topic!r}: "
                    "allow this user to read it."
                )
                raise FeedError(msg)


def back_off_s() -> Iterator[float]:
    """Waits before the attempts to reconnect to a lost broker, s: 1, 2, 4, 8, 8, ..."""
    return itertools.chain((1.0, 2.0, 4.0), itertools.repeat(8.0))


@contextlib.asynccontextmanager
async def connect(
    address: BrokerAddress,
    *,
    topics: Sequence[str] = (),
    on_message: Callable[[str, bytes], None] = lambda _topic, _payload: None,
    on_state: Callable[[bool], None] = lambda _connected: None,
) -> AsyncIterator[FeedClient]:
    """Connect to a broker and stay connected until the context ends.

    A lost broker is tried again after 1, 2, 4, 8, 8, ... s.

    Args:
        address: The broker.
        topics: Topics to subscribe to, QoS 0.
        on_message: Called in the event loop with the topic and payload of each message. It
            must not raise: an exception ends the delivery and comes out of the context.
        on_state: Called with False when the broker is lost and with True when it is back.

    Raises:
        FeedError: If nobody answers there, or the broker refuses this client or a topic.
    """
    feed = FeedClient(address, topics, on_message, on_state)
    await feed._open()
    keeper = asyncio.create_task(feed._keep())
    try:
        yield feed
    finally:
        keeper.cancel()
        try:
            with contextlib.suppress(asyncio.CancelledError):
                await keeper
        finally:
            await _close(feed._client)


async def _enter(client: aiomqtt.Client) -> None:
    # aiomqtt connects in a thread that a cancellation cannot stop. Wait for it, or its socket
    # would stay in the event loop.
    attempt = asyncio.ensure_future(_attempt(client))
    try:
        await asyncio.shield(attempt)
    except asyncio.CancelledError:
        with contextlib.suppress(aiomqtt.MqttError):
            await attempt
            await _close(client)
        raise


async def _attempt(client: aiomqtt.Client) -> None:
    try:
        await client.__aenter__()
    except aiomqtt.MqttError:
        # The socket of a broker that did not answer in time is still open, and the broker
        # will not acknowledge its closing.
        client.timeout = 0.0
        await _close(client)
        raise


async def _close(client: aiomqtt.Client) -> None:
    # A broker that is gone cannot take a DISCONNECT.
    with contextlib.suppress(aiomqtt.MqttError, OSError):
        await client.__aexit__(None, None, None)
