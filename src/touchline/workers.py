# SPDX-License-Identifier: Apache-2.0
"""Processes that work for this one. They end with it, even where it is killed."""

import atexit
import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
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
    pool = ProcessPoolExecutor(count, context, _begin, ([begin, *given],))
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def follow_parent() -> None:
    """End with the process that this one works for, whatever it does then.

    It may hold both ends of the pipe it asks for work, and wait there for ever, or be amid work.
    """
    parent = multiprocessing.parent_process()
    assert parent is not None
    over, ending = multiprocessing.Pipe(duplex=False)
    watch = threading.Thread(target=_end_with_parent, args=(parent.sentinel, over), daemon=True)
    watch.start()
    atexit.register(_end_watch, watch, ending)


def _begin(call: list[Any]) -> None:
    follow_parent()
    begin, *given = call
    call.clear()  # a process keeps its arguments, of which native ones would outlive their types
    if begin is not None:
        begin(*given)


def _end_with_parent(parent: int, over: Connection) -> None:
    if parent in wait([parent, over]):
        os._exit(1)


def _end_watch(watch: threading.Thread, ending: Connection) -> None:
    """Python keeps all that native modules made while a thread lives, and these complain of it."""
    ending.close()
    watch.join()
