# SPDX-License-Identifier: Apache-2.0
"""From the address of a source to the source."""

from collections.abc import Callable

from touchline.live.aside import ReadAside
from touchline.live.connection import Connection
from touchline.live.source import Address, Source, parse_address
from touchline.model.robot import Robot, load_robot


def _simulated(address: Address, robot: Robot) -> Source:
    from touchline.live.simulated import SimulatedArm

    return SimulatedArm(address, robot)


def _replayed(address: Address, robot: Robot) -> Source:
    from touchline.live.replayed import ReplayedLog

    return ReplayedLog(address, robot)


def _ur(address: Address, robot: Robot) -> Source:
    from touchline.live.ur import UrArm

    return UrArm(address, robot)


def _ros(address: Address, robot: Robot) -> Source:
    from touchline.live.ros import RosTopics

    return RosTopics(address, robot)


def _franka(address: Address, robot: Robot) -> Source:
    from touchline.live.franka import FrankaArm

    return FrankaArm(address, robot)


SCHEMES: dict[str, tuple[str, Callable[[Address, Robot], Source]]] = {
    "sim": ("sim://", _simulated),
    "replay": ("replay://LOG?speed=1", _replayed),
    "ros2": ("ros2://", _ros),
    "ur": ("ur://HOST[:PORT]", _ur),
    "franka": ("franka://HOST", _franka),
}


def make_source(source: str, robot: Robot) -> Source:
    """The source of an address, not opened yet.

    What is read by Python code of others (Franka's library) is read in a process of its own, so
    that nothing this program does costs a sample.

    Raises:
        InputError: the address is of no known kind, or cannot be a source of this robot.
    """
    own = own_source(source, robot)
    if _parsed(source).scheme == "franka":
        return ReadAside(source, robot, tuple(s.name for s in own.streams), own.period)
    return own


def own_source(source: str, robot: Robot) -> Source:
    """The same, to be read by this process.

    Raises:
        InputError: as `make_source`.
    """
    address = _parsed(source)
    return SCHEMES[address.scheme][1](address, robot)


def _parsed(source: str) -> Address:
    return parse_address(source, {name: form for name, (form, _) in SCHEMES.items()})


def connect(source: str, robot: Robot | str) -> Connection:
    """Connects to a running robot; iterate over what it returns.

        with tl.live.connect("sim://", robot) as samples:
            for sample in samples:
                result = pipeline.update(*sample)

    Args:
        source: an address as `touchline live --source` takes it.
        robot: the robot, or what `touchline.load_robot` takes.

    Raises:
        InputError: with one clear line, where nothing can be read there.
    """
    model = load_robot(robot) if isinstance(robot, str) else robot
    connection = Connection(make_source(source, model))
    connection.open()
    return connection
