"""Where chunks are flown: order, how far ahead, and what is refused."""

from __future__ import annotations

import multiprocessing
import os
import sys
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

import pytest

from swarmctl.errors import SwarmError, UsageError
from swarmctl.study.executors import _AHEAD, executing, in_order
from tests.brokers import free_port


class Backwards(Executor):
    """Finishes what it was given last first, once someone waits for a result."""

    def __init__(self) -> None:
        self.waiting: list[tuple[Future[Any], Callable[..., Any], tuple[object, ...]]] = []
        self.finished: list[object] = []
        self.outstanding = self.most = 0

    def submit(self, fn: Callable[..., Any], /, *args: object, **_: object) -> Future[Any]:
        future = Waited(self)
        self.waiting.append((future, fn, args))
        self.outstanding += 1
        self.most = max(self.most, self.outstanding)
        return future

    def finish(self) -> None:
        while self.waiting:
            future, fn, args = self.waiting.pop()
            self.finished.append(args[0])
            future.set_result(fn(*args))


class Waited(Future[Any]):
    """A future of :class:`Backwards`."""

    def __init__(self, executor: Backwards) -> None:
        super().__init__()
        self._executor = executor

    def result(self, timeout: float | None = None) -> Any:  # noqa: ANN401 - as Future's
        self._executor.finish()
        self._executor.outstanding -= 1
        return super().result(timeout)


def square(number: int) -> int:
    return number * number


def test_results_come_in_the_order_of_the_work_whoever_finishes_first() -> None:
    executor = Backwards()
    work = list(range(3 * _AHEAD + 5))
    assert list(in_order(executor, square, work)) == [square(number) for number in work]
    assert set(executor.finished) == set(work)
    assert executor.finished != work  # they were finished in another order


def test_no_more_than_a_few_chunks_are_ahead() -> None:
    """Nothing is begun before the first result is asked for, and then only as many."""
    executor = Backwards()
    results = in_order(executor, square, range(1000))
    assert executor.outstanding == 0
    for _ in results:
        assert executor.outstanding < _AHEAD
    assert executor.most == _AHEAD


class Failing(Executor):
    """Fails at the first piece of work, and has not begun with the others."""

    def __init__(self) -> None:
        self.futures: list[Future[Any]] = []

    def submit(self, *_: object, **__: object) -> Future[Any]:
        self.futures.append(Future())
        if len(self.futures) == 1:
            self.futures[0].set_exception(ValueError("broken"))
        return self.futures[-1]


def test_what_was_given_ahead_is_cancelled_when_one_piece_fails() -> None:
    executor = Failing()
    with pytest.raises(ValueError, match="broken"):
        list(in_order(executor, square, range(5)))
    assert [future.cancelled() for future in executor.futures] == [False] + 4 * [True]


def test_without_an_executor_work_is_done_here_when_it_is_asked_for() -> None:
    done: list[int] = []
    results = in_order(None, lambda n: done.append(n) or n, [1, 2, 3])  # type: ignore[func-returns-value]  # to note it
    assert next(results) == 1
    assert done == [1]


def test_one_worker_is_this_process() -> None:
    with executing() as executor:
        assert executor is None


@pytest.mark.live
def test_workers_are_other_processes_and_leave_with_the_context() -> None:
    with executing(workers=2) as executor:
        assert executor is not None
        assert executor.submit(os.getpid).result() != os.getpid()
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize("workers", [0, -3])
def test_fewer_than_one_worker_are_refused(workers: int) -> None:
    with (
        pytest.raises(UsageError, match=f"--workers must be at least 1, not {workers}"),
        executing(workers),
    ):
        pass


def test_workers_and_a_cluster_exclude_each_other() -> None:
    with (
        pytest.raises(UsageError, match="--workers and --executor exclude each other"),
        executing(2, "dask://127.0.0.1:8786"),
    ):
        pass


@pytest.mark.parametrize(
    "address",
    [
        "",
        "127.0.0.1:8786",
        "tcp://127.0.0.1:8786",
        "dask://127.0.0.1",
        "dask://:8786",
        "dask://host:port",
        "dask://host:-1",
    ],
)
def test_an_address_of_another_form_is_refused(address: str) -> None:
    with pytest.raises(UsageError, match="must look like dask://host:port"), executing(1, address):
        pass


def test_without_dask_the_sentence_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(
            SwarmError, match=r"needs dask.distributed: pip install 'swarmctl\[cluster\]'"
        ),
        executing(1, "dask://127.0.0.1:8786"),
    ):
        pass


@pytest.mark.live
def test_a_scheduler_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """The client is given less patience here than it has."""
    distributed = pytest.importorskip("distributed")
    client = distributed.Client
    monkeypatch.setattr(distributed, "Client", lambda address, **_: client(address, timeout=0.2))
    port = free_port()
    with (
        pytest.raises(SwarmError, match=f"No dask scheduler answers at 127.0.0.1:{port}"),
        executing(1, f"dask://127.0.0.1:{port}"),
    ):
        pass
