"""The MQTT client against the embedded broker and a real mosquitto."""

from __future__ import annotations

import asyncio
import gc
import itertools
import shutil
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from amqtt.adapters import StreamReaderAdapter, StreamWriterAdapter
from amqtt.broker import Broker
from amqtt.contexts import BrokerConfig, ListenerConfig, ListenerType

from swarmctl.errors import FeedError, UsageError
from swarmctl.feed import client as client_module
from swarmctl.feed.broker import embedded_broker
from swarmctl.feed.client import BrokerAddress, back_off_s, connect
from tests.brokers import Embedded, Mosquitto, free_port, needs_mosquitto

pytestmark = pytest.mark.live

Inbox = asyncio.Queue[tuple[str, bytes]]


async def run(*command: str) -> None:
    process = await asyncio.create_subprocess_exec(*command, stderr=asyncio.subprocess.DEVNULL)
    assert await process.wait() == 0


def into(inbox: Inbox) -> Callable[[str, bytes], None]:
    return lambda topic, payload: inbox.put_nowait((topic, payload))


@pytest.mark.parametrize(
    ("url", "address"),
    [
        ("mqtt://broker", BrokerAddress("broker", 1883)),
        ("mqtts://broker/", BrokerAddress("broker", 8883, tls=True)),
        ("mqtt://10.0.0.7:2000", BrokerAddress("10.0.0.7", 2000)),
        ("mqtt://[::1]:2000", BrokerAddress("::1", 2000)),
        ("mqtt://ann@broker", BrokerAddress("broker", 1883, username="ann")),
        (
            "mqtts://ann:p%40ss@broker:1",
            BrokerAddress("broker", 1, tls=True, username="ann", password="p@ss"),
        ),
    ],
)
def test_an_address_is_read(url: str, address: BrokerAddress) -> None:
    assert BrokerAddress.parse(url) == address


@pytest.mark.parametrize(
    "url",
    [
        "",
        "broker",
        "broker:1883",
        "http://broker",
        "mqtt://",
        "mqtt://:1883",
        "mqtt://broker:0",
        "mqtt://broker:70000",
        "mqtt://broker:port",
        "mqtt://broker/topic",
        "mqtt://broker?x=1",
        "mqtt://[::1",
    ],
)
def test_anything_else_is_a_usage_error(url: str) -> None:
    with pytest.raises(UsageError) as caught:
        BrokerAddress.parse(url)
    assert str(caught.value) == (
        f"{url!r} is not the address of an MQTT broker: "
        "write mqtt://[user[:password]@]host[:port], or mqtts:// for TLS."
    )


def test_a_password_is_never_shown() -> None:
    address = BrokerAddress.parse("mqtt://ann:secret@[::1]:1")
    assert str(address) == "[::1]:1"
    assert "secret" not in repr(address)
    with pytest.raises(UsageError) as caught:
        BrokerAddress.parse("mqtt://ann:secret@broker/topic")
    assert "secret" not in str(caught.value)


async def test_what_is_published_arrives(broker: Embedded | Mosquitto) -> None:
    inbox: Inbox = asyncio.Queue()
    payloads = [bytes([k]) * (1 + k * 400) for k in range(5)]
    async with (
        connect(broker.address, topics=["swarm/a/tdoa", "swarm/a/truth"], on_message=into(inbox)),
        connect(broker.address) as publisher,
        asyncio.timeout(10),
    ):
        assert await publisher.publish("swarm/b/tdoa", b"not subscribed to")
        for payload in payloads:
            assert await publisher.publish("swarm/a/tdoa", payload)
        assert await publisher.publish("swarm/a/truth", b"")
        assert [await inbox.get() for _ in range(6)] == [
            *[("swarm/a/tdoa", payload) for payload in payloads],
            ("swarm/a/truth", b""),
        ]


async def test_a_lost_broker_is_found_again(
    broker: Embedded | Mosquitto, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client_module, "back_off_s", lambda: itertools.repeat(0.02))
    inbox: Inbox = asyncio.Queue()
    states: asyncio.Queue[bool] = asyncio.Queue()
    async with (
        connect(
            broker.address, topics=["t"], on_message=into(inbox), on_state=states.put_nowait
        ) as client,
        asyncio.timeout(10),
    ):
        for k in range(2):
            await broker.stop()
            assert await states.get() is False
            assert not await client.publish("t", b"lost")
            await broker.start()
            assert await states.get() is True
            assert await client.publish("t", bytes([k]))
            assert await inbox.get() == ("t", bytes([k]))
    assert inbox.empty()
    assert states.empty()


async def test_it_keeps_looking_for_a_broker_that_stays_away(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried_twice = asyncio.Event()

    def waits() -> Iterator[float]:
        for k in itertools.count():
            if k == 2:
                tried_twice.set()
            yield 0.01

    monkeypatch.setattr(client_module, "back_off_s", waits)
    broker = Embedded()
    await broker.start()
    states: asyncio.Queue[bool] = asyncio.Queue()
    async with connect(broker.address, on_state=states.put_nowait), asyncio.timeout(10):
        await broker.stop()
        await tried_twice.wait()
        await broker.start()
        assert [await states.get(), await states.get()] == [False, True]
    await broker.stop()


CONNACK = b"\x20\x02\x00\x00"


async def test_it_says_good_bye() -> None:
    heard = bytearray()
    left = asyncio.Event()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        heard.extend(await reader.read(1000))
        writer.write(CONNACK)
        heard.extend(await reader.read())
        writer.close()
        await writer.wait_closed()
        left.set()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    async with connect(BrokerAddress("127.0.0.1", server.sockets[0].getsockname()[1])):
        pass
    async with asyncio.timeout(2):
        await left.wait()
    server.close()
    assert heard.startswith(b"\x10")  # CONNECT
    assert heard.endswith(b"\xe0\x00")  # DISCONNECT


async def test_a_stalled_broker_does_not_hold_up_the_publisher(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(client_module, "_PUBLISH_TIMEOUT_S", 0.05)
    monkeypatch.setattr(client_module, "_CONNECT_TIMEOUT_S", 2.0)
    enough = asyncio.Event()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1000)
        writer.write(CONNACK)
        await enough.wait()  # and reads no more
        writer.transport.abort()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    address = BrokerAddress("127.0.0.1", server.sockets[0].getsockname()[1])
    async with asyncio.timeout(10), connect(address) as client:
        assert not await client.publish("t", bytes(30_000_000))  # more than the sockets buffer
        enough.set()
    server.close()


def test_the_waits_double_up_to_8_s() -> None:
    assert list(itertools.islice(back_off_s(), 6)) == [1.0, 2.0, 4.0, 8.0, 8.0, 8.0]


async def test_nobody_there_is_one_sentence() -> None:
    address = BrokerAddress("127.0.0.1", free_port())
    with pytest.raises(FeedError) as caught:
        await connect(address).__aenter__()
    assert str(caught.value) == (
        f"No MQTT broker can be reached at {address} ([Errno 111] Connection refused): "
        "start one there or correct the address."
    )


class Mute:
    """A TCP server that accepts one client, says nothing, and waits for it to leave."""

    def __init__(self) -> None:
        self.accepted = asyncio.Event()
        self._left = asyncio.Event()

    async def __aenter__(self) -> BrokerAddress:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        return BrokerAddress("127.0.0.1", self._server.sockets[0].getsockname()[1])

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.accepted.set()
        await reader.read()
        writer.close()
        await writer.wait_closed()
        self._left.set()

    async def __aexit__(self, *_: object) -> None:
        self._server.close()
        async with asyncio.timeout(2):
            await self._left.wait()


async def test_a_server_that_speaks_no_mqtt_is_no_broker(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client_module, "_CONNECT_TIMEOUT_S", 0.05)
    async with Mute() as address:
        with pytest.raises(FeedError, match=f"{address} .Operation timed out"):
            await connect(address).__aenter__()


async def test_a_connection_attempt_can_be_cancelled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client_module, "_CONNECT_TIMEOUT_S", 0.05)
    mute = Mute()
    async with mute as address:
        attempt = asyncio.ensure_future(connect(address).__aenter__())
        await mute.accepted.wait()
        attempt.cancel()
        with pytest.raises(asyncio.CancelledError):
            await attempt


async def test_a_fault_in_the_callback_comes_out() -> None:
    called = asyncio.Event()

    def on_message(_topic: str, _payload: bytes) -> None:
        called.set()
        raise ZeroDivisionError

    async with embedded_broker(port=0) as address, asyncio.timeout(10):
        connection = connect(address, topics=["t"], on_message=on_message)
        client = await connection.__aenter__()
        await client.publish("t", b"")
        await called.wait()
        with pytest.raises(ZeroDivisionError):
            await connection.__aexit__(None, None, None)


async def test_small_messages_are_not_held_back() -> None:
    async with embedded_broker(port=0) as address, connect(address) as client:
        # paho's own socket: no public way leads to it.
        paho_socket = client._client._client.socket()
        assert isinstance(paho_socket, socket.socket)
        assert paho_socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


async def test_a_refused_topic_is_one_sentence() -> None:
    broker = Broker(
        BrokerConfig(
            listeners={"default": ListenerConfig(type=ListenerType.EXTERNAL)},
            plugins={
                "amqtt.plugins.authentication.AnonymousAuthPlugin": {},
                "amqtt.plugins.topic_checking.TopicTabooPlugin": {},
            },
        )
    )

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await broker.external_connected(
            StreamReaderAdapter(reader), StreamWriterAdapter(writer), "default"
        )

    await broker.start()
    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    address = BrokerAddress("127.0.0.1", server.sockets[0].getsockname()[1])
    with pytest.raises(FeedError) as caught:
        await connect(address, topics=["public", "prohibited"]).__aenter__()
    server.close()
    await broker.shutdown()
    assert str(caught.value) == (
        f"The MQTT broker at {address} refuses a subscription to 'prohibited': "
        "allow this user to read it."
    )


@needs_mosquitto
async def test_a_password_is_asked_and_given(tmp_path: Path) -> None:
    passwords = tmp_path / "passwords"
    await run("mosquitto_passwd", "-b", "-c", str(passwords), "ann", "s3cret")
    broker = Mosquitto(tmp_path, f"allow_anonymous false\npassword_file {passwords}")
    await broker.start()
    host, port = broker.address.host, broker.address.port
    try:
        for url in (f"mqtt://{host}:{port}", f"mqtt://ann:wrong@{host}:{port}"):
            with pytest.raises(FeedError) as caught:
                await connect(BrokerAddress.parse(url)).__aenter__()
            assert str(caught.value) == (
                f"The MQTT broker at {host}:{port} refuses the connection (Not authorized): "
                "check the user name and password in its address."
            )
        async with connect(BrokerAddress.parse(f"mqtt://ann:s3cret@{host}:{port}")) as client:
            assert await client.publish("t", b"")
    finally:
        await broker.stop()


@needs_mosquitto
@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl to make a certificate")
# paho leaves the socket of a failed handshake to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
async def test_tls_trusts_what_the_system_trusts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    await run(
        "openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256",
        "-nodes", "-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1",
        "-keyout", str(key), "-out", str(certificate),
    )  # fmt: skip
    broker = Mosquitto(tmp_path, f"allow_anonymous true\ncertfile {certificate}\nkeyfile {key}")
    await broker.start()
    address = BrokerAddress.parse(f"mqtts://{broker.address}")
    try:
        with pytest.raises(FeedError, match=f"{address} .*certificate verify failed"):
            await connect(address).__aenter__()
        monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
        inbox: Inbox = asyncio.Queue()
        async with (
            connect(address, topics=["t"], on_message=into(inbox)) as client,
            asyncio.timeout(10),
        ):
            assert await client.publish("t", b"x" * 5000)
            assert await inbox.get() == ("t", b"x" * 5000)
    finally:
        await broker.stop()
    gc.collect()
