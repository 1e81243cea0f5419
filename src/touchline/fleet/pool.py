# SPDX-License-Identifier: Apache-2.0
"""Processes that analyze recordings; one that is killed costs its recording a second try."""

import multiprocessing
import time
from collections import deque
from collections.abc import Iterator, Sequence
from multiprocessing.connection import wait
from typing import Any, Self

from touchline.fleet.manifest import Row
from touchline.fleet.work import Job, blank, serve

TRIES = 2
FAREWELL = 5.0  # s that a process without a job has to end


class _Worker:
    """A process, and the job it has."""

    def __init__(self, memory: int | None) -> None:
        context = multiprocessing.get_context("spawn")  # native threads do not survive a fork
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=serve, args=(theirs, memory), daemon=True)
        self.process.start()
        theirs.close()
        self.job: Job | None = None
        self.began = 0.0

    def give(self, job: Job) -> None:
        self.job, self.began = job, time.monotonic()
        self.pipe.send(job)

    def end(self) -> None:
        """End it: at once while it has a job, else by closing its pipe, so that it cleans up."""
        if self.job is not None:
            self.process.kill()
        self.pipe.close()
        self.process.join(FAREWELL)
        self.process.kill()
        self.process.join()


class Pool:
    """Workers that take jobs as they become free.

    Args:
        workers: number of processes.
        seconds: that a recording may take, or None.
        memory: that a process may take [bytes], or None.
    """

    def __init__(self, workers: int, seconds: float | None, memory: int | None) -> None:
        self._count, self._seconds, self._memory = workers, seconds, memory
        self._workers: list[_Worker] = []

    def rows(self, jobs: Sequence[Job]) -> Iterator[Row]:
        """A row for each job, as they are done."""
        waiting = deque(jobs)
        tries: dict[str, int] = {}
        while waiting or any(worker.job for worker in self._workers):
            self._employ(waiting)
            for worker in self._ready():
                row = self._row(worker, tries, waiting)
                if row is not None:
                    yield row

    def _employ(self, waiting: deque[Job]) -> None:
        idle = [worker for worker in self._workers if worker.job is None]
        while waiting and (idle or len(self._workers) < self._count):
            worker = idle.pop() if idle else _Worker(self._memory)
            if worker not in self._workers:
                self._workers.append(worker)
            try:
                worker.give(waiting[0])
                waiting.popleft()
            except OSError:  # killed while it had nothing to do
                self._dismiss(worker)

    def _ready(self) -> list[_Worker]:
        """Workers that have answered, died, or take too long."""
        busy = [worker for worker in self._workers if worker.job is not None]
        handles: list[Any] = [w.pipe for w in busy] + [w.process.sentinel for w in busy]
        told = wait(handles, self._patience(busy))
        late = self._late(busy)
        return [w for w in busy if w.pipe in told or w.process.sentinel in told or w in late]

    def _row(self, worker: _Worker, tries: dict[str, int], waiting: deque[Job]) -> Row | None:
        """What became of a worker's job; None where it is tried again."""
        job, worker.job = worker.job, None
        assert job is not None
        try:
            if worker.pipe.poll():
                return worker.pipe.recv()
        except (EOFError, OSError):  # it died while it answered
            pass
        late = worker in self._late([worker])
        worker.process.kill()
        self._dismiss(worker)
        if late:
            return blank(job, "failed", f"took longer than {self._seconds:g} s")
        tries[job.recording.name] = tries.get(job.recording.name, 0) + 1
        if tries[job.recording.name] < TRIES:
            waiting.append(job)
            return None
        return blank(job, "failed", f"its process was killed, {TRIES} times")

    def _patience(self, busy: list[_Worker]) -> float | None:
        if self._seconds is None:
            return None
        left = [worker.began + self._seconds - time.monotonic() for worker in busy]
        return max(min(left, default=0.0), 0.0)

    def _late(self, busy: list[_Worker]) -> list[_Worker]:
        now = time.monotonic()
        return [w for w in busy if self._seconds is not None and now - w.began > self._seconds]

    def _dismiss(self, worker: _Worker) -> None:
        worker.end()
        if worker in self._workers:
            self._workers.remove(worker)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for worker in list(self._workers):
            self._dismiss(worker)
