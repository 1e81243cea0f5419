# SPDX-License-Identifier: Apache-2.0
# pyright: reportMissingImports=false
"""`franka://HOST`: a Franka arm, read at 1 kHz with franky-control; nothing moves.

franky sets the arm's collision thresholds whenever it connects, which no option of it prevents.
"""

import time
from collections.abc import Callable
from typing import Any

from touchline.errors import InputError
from touchline.live.adapters import from_franka
from touchline.live.sample import Sample
from touchline.live.source import Address, LinkLost
from touchline.live.streams import Stream
from touchline.model.robot import Robot

PERIOD = 1e-3  # s
JOINTS = 7
PAUSE = 0.05  # s; behind a longer one the first states are old
QUEUED = 1.0 / 3.0  # of its clock's step: a state that comes sooner waited in a queue
ENOUGH = 2  # states in a row that did not
REFLEXES = (
    "franky sets the arm's collision thresholds to 20 Nm and 30 N as it connects: set your own "
    "again, or read the arm with ros2://"
)
MOST = 20  # states that are looked at in one read


class FrankaArm:
    """A Franka arm as a source.

    Args:
        address: `franka://HOST`.
        robot: with seven joints, in the arm's order, and no force-torque sensor.
        connect: makes a robot object of a host; default: franky's.

    Raises:
        InputError: the robot cannot be a Franka arm, or the library is missing.
    """

    def __init__(
        self, address: Address, robot: Robot, connect: Callable[[str], Any] | None = None
    ) -> None:
        address.only()
        self.name, self._robot = address.text, robot
        self._host, _ = address.host(1)
        if len(robot.joint_names) != JOINTS:
            raise InputError(
                f"{address.text}: a Franka arm has {JOINTS} joints, but robot {robot.name} has "
                f"{len(robot.joint_names)}"
            )
        if robot.sensor_names:
            raise InputError(
                f"{address.text}: reads the arm alone, but robot {robot.name} has force-torque "
                f"sensors ({', '.join(robot.sensor_names)}); use ros2:// for both together"
            )
        self._connect = connect or _franky(address)
        self.period: float | None = PERIOD
        self.streams = (Stream("franka", PERIOD),)
        self._arm: Any = None
        self._number = 0  # of the last state that was handed on

    def open(self) -> list[str]:
        """Connects; after a fault of the network only a new robot object helps."""
        try:
            self._arm = self._connect(self._host)
        except Exception as error:  # the library raises many kinds
            raise _judged(error, self._host) from None
        self._last, self._heard, self._in_time = -1.0, 0.0, 0
        return [REFLEXES]

    def read(self, timeout: float) -> list[Sample]:
        """The states that have come; old ones behind a pause are left out."""
        found: list[Sample] = []
        end = time.monotonic() + timeout
        while len(found) < MOST:
            try:
                state = self._arm.state  # waits for the next one
            except Exception as error:  # the library raises many kinds
                raise LinkLost(f"{self._host}: {_first_line(error)}") from None
            now = time.monotonic()
            sample = from_franka(self._robot, state, arrival=now)
            if sample.time != self._last and self._is_fresh(sample, now):
                self._note(sample)
                found.append(sample)
            self._last = sample.time
            if found or now >= end:
                break
        return found

    def _note(self, sample: Sample) -> None:
        stream, number = self.streams[0], sample.sequence
        lost = max(number - self._number - 1, 0) if stream.received else 0
        stream.receive(sample.time, sample.arrival, bool(sample.valid.q.all()), lost)
        self._number = number

    def _is_fresh(self, sample: Sample, now: float) -> bool:
        """Old states behind a pause come all at once; some that come in their time end that."""
        pause, self._heard = now - self._heard, now
        step = sample.time - self._last
        if pause > PAUSE:
            self._in_time = 0
        elif step > 0.0 and self._in_time < ENOUGH:
            self._in_time = self._in_time + 1 if pause > QUEUED * step else 0
        return self._in_time >= ENOUGH

    def close(self) -> None:
        """Lets go of the robot."""
        self._arm = None


def _franky(address: Address) -> Callable[[str], Any]:
    try:
        import franky
    except ModuleNotFoundError as error:
        raise InputError(
            f"{address.text}: {error.name} is not installed: pip install 'touchline[franka]'"
        ) from None
    # Reading needs no real-time kernel; commands would.
    return lambda host: franky.Robot(host, realtime_config=franky.RealtimeConfig.Ignore)


def _judged(error: Exception, host: str) -> Exception:
    """A fault of the network may pass; anything else will not."""
    told = f"{host}: {_first_line(error)}"
    passing = type(error).__name__ in ("NetworkException", "TimeoutError", "ConnectionError")
    return LinkLost(told) if passing else InputError(told)


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
