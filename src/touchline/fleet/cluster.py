# SPDX-License-Identifier: Apache-2.0
"""Recordings analyzed by a dask.distributed cluster that is there already."""

from collections.abc import Iterator, Sequence
from typing import Self

from touchline.errors import InputError
from touchline.extras import need
from touchline.fleet.manifest import Row
from touchline.fleet.work import Job, blank, done

RETRIES = 1  # as of the pool: a worker that is killed costs a second try
PATIENCE = 30.0  # s to reach the scheduler


class Cluster:
    """Gives jobs to the workers of a cluster; they see the same folders and have Touchline.

    Args:
        address: of the scheduler, such as tcp://10.0.0.1:8786.

    Raises:
        InputError: nothing answers there.
        ModuleNotFoundError: distributed is not installed.
    """

    def __init__(self, address: str) -> None:
        distributed = need("distributed")
        try:
            # Of no address the client complains once more when it is left.
            distributed.comm.resolve_address(address)
            self._client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(f"--cluster {address}: cannot be reached: {error}") from None
        self._completed = distributed.as_completed

    def rows(self, jobs: Sequence[Job]) -> Iterator[Row]:
        """A row for each job, as they are done."""
        futures = self._client.map(done, jobs, pure=False, retries=RETRIES)
        waiting = {future.key: job for future, job in zip(futures, jobs, strict=True)}
        for future in self._completed(futures, loop=self._client.loop):
            job = waiting[future.key]
            try:
                row = future.result()
            except Exception as error:  # the worker was lost, or cannot import Touchline
                row = blank(job, "failed", f"{type(error).__name__}: {error}".splitlines()[0])
            future.release()
            yield row

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()
