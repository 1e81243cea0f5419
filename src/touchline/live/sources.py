# SPDX-License-Identifier: Apache-2.0
"""From the address of a source to the source."""

from touchline.live.aside import ReadAside
from touchline.live.connection import Connection
from touchline.live.schemes import own_source, parsed
from touchline.live.source import Source
from touchline.model.robot import Robot, load_robot


def make_source(source: str, robot: Robot) -> Source:
    """The source of an address, not opened yet.

    What is read by Python code of others (Franka's library) is read in a process of its own, so
    that nothing this program does costs a sample.

    Raises:
        InputError: the address is of no known kind, or cannot be a source of this robot.
    """
    own = own_source(source, robot)
    if parsed(source).scheme == "franka":
        return ReadAside(source, robot, tuple(s.name for s in own.streams), own.period)
    return own


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
