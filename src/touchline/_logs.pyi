"""Native readers of recordings: CDR messages, MCAP chunks and CSV text."""

from collections.abc import Sequence

import numpy
import numpy.typing


class JointStateDecoder:
    """Reads JointState messages in the order of given joints."""

    def __init__(self, joints: Sequence[str]) -> None: ...

    def decode(self, buffer: bytes, start: numpy.typing.NDArray[numpy.int64], size: numpy.typing.NDArray[numpy.int64]) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.bool_], int]:
        """
        Stamps (m,) [s], position, velocity, effort (m, n), which messages name every joint (m,), and how many are damaged. NaN is what a message lacks.
        """

    @property
    def seen(self, /) -> list[str]:
        """Names of all joints met so far, in the order in which they came."""

def decode_wrenches(buffer: bytes, start: numpy.typing.NDArray[numpy.int64], size: numpy.typing.NDArray[numpy.int64]) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], int]:
    """
    Stamps (m,) [s], wrenches (m, 6) [N, Nm] of WrenchStamped messages, and how many are damaged.
    """

def chunk_messages(records: bytes, wanted: numpy.typing.NDArray[numpy.uint8], index: numpy.typing.NDArray[numpy.int64]) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], bool]:
    """
    Channel, time received [ns], start and size of each message in an MCAP chunk's records, and whether something in it is damaged; `wanted` has a flag per channel, `index` the offsets of messages as the file's indexes tell them.
    """

def read_csv(text: bytes, delimiter: str, cells: int, wanted: list[int]) -> tuple[numpy.typing.NDArray[numpy.float64], int, tuple[int, int, int, bytes] | None]:
    """
    Wanted columns (N, w) of whole lines, the number of lines read, and the first problem: its line, the number of cells where that is wrong, else 0, its column and what stands there.
    """

def write_csv(values: numpy.typing.NDArray[numpy.float64]) -> bytes:
    """
    Rows of numbers (N, w) as text that reads back to the last bit; NaN is an empty cell.
    """
