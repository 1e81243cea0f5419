# SPDX-License-Identifier: Apache-2.0
"""The kinds of address, and the source that each of them is, read by this process."""

from collections.abc import Callable

from touchline.live.source import Address, Source, parse_address
from touchline.model.robot import Robot


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


def own_source(source: str, robot: Robot) -> Source:
    """The source of an address, not opened yet, to be read by this process.

    Raises:
        InputError: the address is of no known kind, or cannot be a source of this robot.
    """
    address = parsed(source)
    return SCHEMES[address.scheme][1](address, robot)


def parsed(source: str) -> Address:
    """The parts of an address of a known kind; InputError for another."""
    return parse_address(source, {name: form for name, (form, _) in SCHEMES.items()})
