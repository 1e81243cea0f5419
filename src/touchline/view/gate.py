# SPDX-License-Identifier: Apache-2.0
"""What visitors' messages may say: anything else is dropped before the page's server reads it.

A page only sends what its controls allow. A program that speaks to the server by itself may send
text for a number, a number out of its range, or one that is not finite.
"""

import math
import time
from collections.abc import Awaitable, Callable
from typing import Any

import msgspec
import viser
from viser import _messages

MOST_VISITORS = 20  # at a time: each is sent all that moves
RATE = 300.0  # 1/s, messages of one visitor: a page sends some 60 while its view turns
BURST = 1000.0  # messages at once: a page greets with some dozens
LARGEST_NUMBER = 1e6  # m, pixels or units of a control: nothing on a page is larger
TOO_MANY, LATER = 1008, 1013  # why a connection is closed: a rule is broken; try again later
TYPED = {
    kind.__name__: kind
    for kind in (
        _messages.ViewerCameraMessage,
        _messages.SceneNodeClickMessage,
        _messages.SceneNodeDragMessage,
        _messages.GuiUpdateMessage,
    )
}


class Gate:
    """Judges messages.

    Args:
        page: whose controls know what their values may be.

    Raises:
        RuntimeError: this version of viser keeps its controls elsewhere.
    """

    def __init__(self, page: viser.ViserServer) -> None:
        if not hasattr(page.gui, "_gui_input_handle_from_uuid"):
            raise RuntimeError(f"the controls of viser {viser.__version__} cannot be guarded")
        self._page = page

    def admits(self, raw: bytes | str) -> bool:
        """Whether a message may be read."""
        if isinstance(raw, str):
            return False
        try:
            message = msgspec.msgpack.decode(raw)
            kind = message.pop("type")
            if kind in TYPED:
                msgspec.convert(message, TYPED[kind])
            elif kind not in _messages.Message._subclass_from_type_string():
                return False
        except (ValueError, AttributeError, KeyError, TypeError, RecursionError):
            return False
        if not _is_moderate(message):
            return False
        return kind != "GuiUpdateMessage" or self._is_allowed(message["uuid"], message["updates"])

    def _is_allowed(self, uuid: str, updates: dict[str, Any]) -> bool:
        handle: Any = self._page.gui._gui_input_handle_from_uuid.get(uuid)
        if handle is None:
            return False
        return set(updates) == {"value"} and fits(handle, updates["value"])


def fits(control: Any, value: Any) -> bool:
    """Whether a control of a page can have a value."""
    now = control.value
    if isinstance(now, bool):
        return isinstance(value, bool)
    if isinstance(now, int | float):
        low, high = getattr(control, "min", -math.inf), getattr(control, "max", math.inf)
        return _is_number(value) and low <= value <= high
    if isinstance(now, str):
        return isinstance(value, str) and value in getattr(control, "options", (value,))
    return True


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_moderate(value: Any) -> bool:
    """Whether all numbers in a message are finite and none is huge."""
    if isinstance(value, bool):
        return True
    if isinstance(value, int | float):
        return math.isfinite(value) and abs(value) <= LARGEST_NUMBER
    if isinstance(value, dict):
        return all(map(_is_moderate, value.values()))
    if isinstance(value, list | tuple):
        return all(map(_is_moderate, value))
    return True


class Allowance:
    """How many messages a visitor may send: so many at once, and so many a second.

    Args:
        now: the time of its first message [s].
    """

    def __init__(self, now: float) -> None:
        self._left, self._time = BURST, now

    def take(self, now: float) -> bool:
        """Whether one more may be sent."""
        self._left = min(BURST, self._left + RATE * (now - self._time))
        self._time = now
        self._left -= 1.0
        return self._left >= 0.0


class GatedConnection:
    """A WebSocket connection of which only admitted messages are read, and not too many.

    Args:
        connection: of a visitor.
        admits: whether a message may be read.
    """

    def __init__(self, connection: Any, admits: Callable[[bytes | str], bool]) -> None:
        self._connection, self._admits = connection, admits
        self._allowance = Allowance(time.monotonic())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._connection, name)

    async def recv(self, *args: Any, **options: Any) -> bytes | str:
        """The next message that is admitted; who sends too many is sent away."""
        while True:
            message = await self._connection.recv(*args, **options)
            if not self._allowance.take(time.monotonic()):
                await self._connection.close(TOO_MANY, "too many messages")
            elif self._admits(message):
                return message


def gated(
    handler: Callable[[Any], Awaitable[None]], admits: Callable[[bytes | str], bool]
) -> Callable[[Any], Awaitable[None]]:
    """The handler of connections: messages are judged first, and visitors are not too many."""
    visitors: set[Any] = set()

    async def handle(connection: Any) -> None:
        if len(visitors) >= MOST_VISITORS:
            await connection.close(LATER, "too many visitors")
            return
        visitors.add(connection)
        try:
            await handler(GatedConnection(connection, admits))
        finally:
            visitors.discard(connection)

    return handle
