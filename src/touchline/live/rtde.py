# SPDX-License-Identifier: Apache-2.0
"""RTDE, the real-time data exchange of Universal Robots controllers, as far as reading needs it.

Protocol 2 over TCP: packages of a size (2 bytes, big endian, itself included), a type (1 byte) and
a payload. Only outputs are asked for: nothing here can command a robot.
"""

import socket
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Self

from touchline.errors import InputError
from touchline.live.source import LinkLost

PORT = 30004
VERSION = 2
ANSWER = 2.0  # s until a controller answers
LONGEST = 4096  # bytes of a package that a controller sends
NOT_FOUND = "NOT_FOUND"

_FORMATS = {
    "BOOL": "?",
    "UINT8": "B",
    "UINT32": "I",
    "UINT64": "Q",
    "INT32": "i",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
    "VECTOR6UINT32": "6I",
}


class Command(IntEnum):
    """Types of packages."""

    PROTOCOL_VERSION = ord("V")
    TEXT = ord("M")
    DATA = ord("U")
    OUTPUTS = ord("O")
    START = ord("S")
    PAUSE = ord("P")


def package(command: int, payload: bytes = b"") -> bytes:
    """A package as it is sent."""
    return struct.pack(">HB", 3 + len(payload), command) + payload


def packages(buffer: bytearray) -> Iterator[tuple[int, bytes]]:
    """Takes whole packages from the front of a buffer.

    Raises:
        ValueError: the bytes are none of this protocol.
    """
    while len(buffer) >= 3:
        size, command = struct.unpack_from(">HB", buffer)
        if not 3 <= size <= LONGEST or command not in Command.__members__.values():
            raise ValueError(f"unexpected bytes {bytes(buffer[:8])!r}")
        if len(buffer) < size:
            return
        payload = bytes(buffer[3:size])
        del buffer[:size]
        yield command, payload


@dataclass(frozen=True)
class Recipe:
    """What a data package holds.

    Attributes:
        number: of the recipe; packages of another one are not ours.
        names: of the fields, in their order.
        kinds: their types.
    """

    number: int
    names: tuple[str, ...]
    kinds: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "_layout", struct.Struct(">B" + self._codes()))

    def offset(self, name: str | None) -> int:
        """Where a field begins in a package [bytes]; -1 where it is not in it."""
        if name is None:
            return -1
        kinds = self.kinds[: self.names.index(name)]
        return struct.calcsize(">B" + "".join(_FORMATS[kind] for kind in kinds))

    @property
    def size(self) -> int:
        """Of a package [bytes]."""
        return struct.calcsize(">B" + self._codes())

    def _codes(self) -> str:
        return "".join(_FORMATS[kind] for kind in self.kinds)

    def read(self, payload: bytes) -> dict[str, tuple[float, ...]] | None:
        """Values by field; None for a package of another recipe or size."""
        layout: struct.Struct = self._layout  # type: ignore[attr-defined]
        if len(payload) != layout.size or payload[0] != self.number:
            return None
        values = layout.unpack(payload)
        found, at = {}, 1
        for name, kind in zip(self.names, self.kinds, strict=True):
            width = int(_FORMATS[kind][:-1] or 1)
            found[name] = values[at : at + width]
            at += width
        return found


class Rtde:
    """A connection to a controller.

    Args:
        host: of the controller.
        port: usually 30004.

    Raises:
        InputError: there is no such host, or what answers there speaks something else.
        LinkLost: nobody answers now.
    """

    def __init__(self, host: str, port: int = PORT) -> None:
        self.peer = f"{host}:{port}"
        self._buffer = bytearray()
        self.messages: list[str] = []
        try:
            self._socket = socket.create_connection((host, port), timeout=ANSWER)
        except socket.gaierror as error:
            raise InputError(f"{host}: no such host ({error.strerror})") from None
        except OSError as error:
            raise LinkLost(f"{self.peer} cannot be reached ({_reason(error)})") from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            (accepted,) = self._ask(Command.PROTOCOL_VERSION, struct.pack(">H", VERSION))[:1]
            if not accepted:
                raise InputError(
                    f"{self.peer} refuses version {VERSION} of the RTDE protocol; it needs "
                    "PolyScope 3.6 or later"
                )
        except BaseException:
            self.close()
            raise

    def outputs(self, names: Sequence[str], frequency: float) -> tuple[Recipe, list[str]]:
        """Asks for fields.

        Returns:
            The recipe of those that there are, and the names of those that there are not.
        """
        missing: list[str] = []
        wanted = list(names)
        while True:
            answer = self._ask(
                Command.OUTPUTS, struct.pack(">d", frequency) + ",".join(wanted).encode()
            )
            kinds = answer[1:].decode(errors="replace").split(",")
            if len(kinds) != len(wanted):
                raise InputError(f"{self.peer} gives {len(kinds)} types for {len(wanted)} fields")
            lacking = [n for n, kind in zip(wanted, kinds, strict=True) if kind == NOT_FOUND]
            if not lacking:
                break
            missing += lacking
            wanted = [name for name in wanted if name not in lacking]
            if not wanted:
                raise InputError(f"{self.peer} has none of the fields {', '.join(names)}")
        odd = [kind for kind in kinds if kind not in _FORMATS]
        if odd:
            raise InputError(f"{self.peer} gives fields of unknown type {', '.join(odd)}")
        return Recipe(answer[0], tuple(wanted), tuple(kinds)), missing

    def start(self) -> None:
        """Lets the data come."""
        if not self._ask(Command.START)[:1] == b"\x01":
            raise LinkLost(f"{self.peer} does not start to send")

    def receive(self, timeout: float) -> list[bytes]:
        """Payloads of the data packages that have come, after waiting so long [s] at most.

        Raises:
            LinkLost: the connection is broken.
        """
        found = self._data()
        if not found:
            self._fill(timeout)
            found = self._data()
        return found

    def hand_over(self) -> tuple[int, bytes]:
        """For another reader: the socket's number, and what was received and not looked at."""
        begun = bytes(self._buffer)
        self._buffer.clear()
        return self._socket.fileno(), begun

    def _data(self) -> list[bytes]:
        found = []
        try:
            for command, payload in packages(self._buffer):
                if command == Command.DATA:
                    found.append(payload)
                elif command == Command.TEXT:
                    self._note(payload)
        except ValueError as error:
            raise LinkLost(f"{self.peer} sends no RTDE any more: {error}") from None
        return found

    def _note(self, payload: bytes) -> None:
        size = payload[0] if payload else 0
        self.messages = [*self.messages[-20:], payload[1 : 1 + size].decode(errors="replace")]

    def _fill(self, timeout: float) -> bool:
        """Takes what has come into the buffer; False where nothing came in time."""
        self._socket.settimeout(max(timeout, 1e-4))
        try:
            data = self._socket.recv(1 << 16)
        except TimeoutError:
            return False
        except OSError as error:
            raise LinkLost(f"the connection to {self.peer} broke ({_reason(error)})") from None
        if not data:
            raise LinkLost(f"{self.peer} has closed the connection")
        self._buffer += data
        return True

    def _ask(self, command: Command, payload: bytes = b"") -> bytes:
        """The answer to a request; data that comes meanwhile is dropped."""
        try:
            self._socket.settimeout(ANSWER)
            self._socket.sendall(package(command, payload))
        except OSError as error:
            raise LinkLost(f"the connection to {self.peer} broke ({_reason(error)})") from None
        while True:
            try:
                for kind, content in packages(self._buffer):
                    if kind == command and content:
                        return content
                    if kind == Command.TEXT:
                        self._note(content)
            except ValueError as error:
                raise InputError(f"{self.peer} does not speak RTDE: {error}") from None
            if not self._fill(ANSWER):
                raise LinkLost(f"{self.peer} accepts connections but does not answer as RTDE does")

    def close(self) -> None:
        """Disconnects."""
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _reason(error: OSError) -> str:
    return error.strerror or str(error) or type(error).__name__
