# SPDX-License-Identifier: Apache-2.0
"""Processes that work for this one. They end with it, even where it is killed."""

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import wait
from typing import Any


@contextmanager
def workers(
    count: int | None, begin: Callable[..., object] | None = None, *given: Any
) -> Iterator[ProcessPoolExecutor]:
    """So many processes; what has not begun when they are left is not done.

    Args:
        count: of processes; None: one for each core.
        begin: is called in each, before anything else.
        *given: what it is called with.
    """
    context = multiprocessing.get_context("spawn")  # native threads do not survive a fork
    pool = ProcessPoolExecutor(count, context, _begin, (begin, given))
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def _begin(begin: Callable[..., object] | None, given: tuple[Any, ...]) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if begin is not None:
        begin(*given)


def _end_with_parent() -> None:
    """Each worker holds both ends of the pipe it asks for work: it would wait there for ever."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)
