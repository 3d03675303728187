"""Backends that fly trials: the interface of all, and executors of the caller."""

from __future__ import annotations

from concurrent.futures import Executor, Future
from typing import Protocol

from sim.study.tasks import Task
from sim.study.trial import Flown, fly


class Backend(Protocol):
    """Executor of trials that can end one."""

    def room(self) -> bool:
        """True if another task may be submitted."""

    def submit(self, task: Task, *, keep: bool, timeout: float | None) -> Future[Flown]:
        """`sim.study.trial.fly` of a task, to come."""

    def started(self, future: Future[Flown]) -> bool:
        """True if it flies by now."""

    def drop(self, future: Future[Flown]) -> None:
        """Waste no more on a task that hangs."""


class Borrowed:
    """Executor of the caller. A trial that hangs in it cannot be killed, and keeps its place."""

    def __init__(self, executor: Executor) -> None:
        self._executor = executor

    def room(self) -> bool:
        """Always, as an executor has a queue."""
        return True

    def submit(self, task: Task, *, keep: bool, timeout: float | None) -> Future[Flown]:
        """Submit as to any executor."""
        return self._executor.submit(fly, task, keep=keep, timeout=timeout)

    def started(self, future: Future[Flown]) -> bool:
        """As the future says."""
        return future.running()

    def drop(self, future: Future[Flown]) -> None:
        """Cancel, which helps only what has not started."""
        future.cancel()
