"""Where chunks are flown: in this process, in several, or on a dask cluster."""

from __future__ import annotations

import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from swarmctl.errors import SwarmError, UsageError

Work = TypeVar("Work")
Result = TypeVar("Result")

_AHEAD = 32
"""Chunks given to an executor before the oldest has come back: keeps 16 workers busy, and
bounds what waits in memory for its turn."""


def in_order(
    executor: Executor | None, fly: Callable[[Work], Result], work: Sequence[Work]
) -> Iterator[Result]:
    """Results in the order of the work, whoever finishes first.

    Args:
        executor: Where the work is done; None for this process.
        fly: The function to call; importable by name.
        work: Its arguments, one for each call.
    """
    if executor is None:
        yield from map(fly, work)
        return
    waiting: deque[Future[Result]] = deque()
    try:
        for item in work:
            if len(waiting) == _AHEAD:
                yield waiting.popleft().result()
            waiting.append(executor.submit(fly, item))
        while waiting:
            yield waiting.popleft().result()
    finally:
        for future in waiting:
            future.cancel()


@contextmanager
def executing(
    workers: int = 1, address: str | None = None, files: Sequence[Path] = ()
) -> Iterator[Executor | None]:
    """An executor while the context lasts.

    Args:
        workers: Processes on this machine; 1 is this process.
        address: Address of a dask scheduler, ``dask://host:port``, instead.
        files: Python files the workers of a cluster need besides this package.

    Raises:
        UsageError: workers is below 1, or the address has another form.
        SwarmError: dask.distributed is not installed, or the scheduler does not answer.
    """
    if workers < 1:
        raise UsageError(f"--workers must be at least 1, not {workers}.")
    if address is not None:
        if workers != 1:
            raise UsageError("--workers and --executor exclude each other.")
        with _dask(address, files) as executor:
            yield executor
    elif workers == 1:
        yield None
    else:
        # Fresh processes: forking one that has threads (numpy's, a progress bar's) may hang.
        context = multiprocessing.get_context("spawn")
        executor = ProcessPoolExecutor(
            workers,
            mp_context=context,
            # Ctrl-C reaches the whole group; the parent alone answers it.
            initializer=signal.signal,
            initargs=(signal.SIGINT, signal.SIG_IGN),
        )
        try:
            yield executor
        finally:
            executor.shutdown(cancel_futures=True)


@contextmanager
def _dask(address: str, files: Sequence[Path]) -> Iterator[Executor]:
    scheme, _, place = address.partition("://")
    host, _, port = place.rpartition(":")
    if scheme != "dask" or not host or not port.isdigit():
        raise UsageError(f"--executor {address} must look like dask://host:port.")
    try:
        from distributed import Client  # noqa: PLC0415 - an extra
    except ImportError:
        raise SwarmError(
            "--executor dask://... needs dask.distributed: pip install 'swarmctl[cluster]'."
        ) from None
    try:
        client = Client(f"tcp://{place}", timeout=5)
    except (OSError, TimeoutError) as error:
        raise SwarmError(f"No dask scheduler answers at {place}.") from error
    with client:
        for path in files:
            # Not loaded at once: a worker imports it when it is given the first of its filters.
            client.upload_file(str(path), load=False)
        yield client.get_executor()
