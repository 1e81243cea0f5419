# SPDX-License-Identifier: Apache-2.0
# pyright: reportMissingImports=false
"""`ros2://`: topics of joint states and wrenches, unsynchronised, matched by name.

rclpy finds the topics and subscribes. A native thread takes the messages, past Python.
"""

import atexit
import os
import time
from typing import Any

import numpy as np

from touchline.errors import InputError
from touchline.live.loopback import RANGE, keep_local
from touchline.live.rcl import Rcl, find_rcl
from touchline.live.runner import SLOTS, Felt
from touchline.live.sample import Sample
from touchline.live.source import Address
from touchline.live.streams import Stream
from touchline.logs.cdr import JOINT_STATE, WRENCH_STAMPED
from touchline.logs.naming import Naming, parse_naming
from touchline.logs.topics import choose_topics
from touchline.model.description import AXES, RobotDescription
from touchline.model.robot import Robot
from touchline.native import core
from touchline.pipeline.pipeline import Pipeline
from touchline.suggest import did_you_mean, listing

DISCOVERY = 8.0  # s in which the topics have to appear: drivers start beside this program
SETTLE = 0.2  # s between two looks at the topics
DEPTH = 2000  # messages that wait for this program: two seconds at 1 kHz
INCOMPLETE = 20  # joint states without a joint, before the first whole one: it is not there
UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"  # of ROS 2
FELT = "/external_joint_torques"  # what Touchline's node publishes, as joint states too


class RosTopics:
    """Topics of `sensor_msgs/JointState` and `geometry_msgs/WrenchStamped` as a source.

    Each joint state makes a sample, with each sensor's last wrench by then and its age; the topics
    and names are those under `log` of the description, as for a rosbag2. A message without a stamp
    counts from when it was received.

    Args:
        address: `ros2://?reliable=0&depth=2000`; best effort unless `reliable=1`.
        robot: whose joints and sensors are looked for.

    Raises:
        InputError: ROS 2 is not there, or the description's `log` key is wrong.
    """

    def __init__(self, address: Address, robot: Robot) -> None:
        address.only("reliable", "depth", "wait")
        self.name, self._robot = address.text, robot
        self._reliable = address.number("reliable", 0.0) > 0.0
        self._depth = int(address.number("depth", DEPTH, 1.0))
        self._discovery = address.number("wait", DISCOVERY)
        if address.place:
            raise InputError(f"{address.text}: expected ros2://; topics are named under `log`")
        self._ros = _Ros(address.text)
        self._naming = parse_naming(robot.description)
        self.period: float | None = None
        self.streams = (Stream("joints"), *(Stream(name) for name in robot.sensor_names))
        self._node: Any = None
        self._context: Any = None
        self._reader: core.TopicReader | None = None
        self._felt: Felt | None = None
        self._complete = False  # a joint state has named all joints

    def open(self) -> list[str]:
        """Joins the graph, looks for the topics and subscribes."""
        ros, local = self._ros, keep_local()
        self._context = ros.rclpy.Context()
        # Ctrl-C is for the program that reads.
        ros.rclpy.init(context=self._context, signal_handler_options=ros.no_signals)
        self._node = ros.rclpy.create_node(
            "touchline_live", context=self._context, start_parameter_services=False
        )
        joints, wrenches = self._topics()
        names = {joints: "joints"} | {topic: sensor for sensor, topic in wrenches.items()}
        notes = [local] if local else []
        notes += [f"{names[topic]}: {topic}" for topic in names]
        notes += [line for topic in names for line in self._unheard(topic)]
        subscriptions = [
            self._subscribe(ros.joint_state, joints),
            *(self._subscribe(ros.wrench, wrenches[name]) for name in self._robot.sensor_names),
        ]
        self._reader = make_reader(
            self._robot.description,
            self._naming,
            ros.rcl,
            [s.handle.pointer for s in subscriptions],
        )
        atexit.register(self.close)  # the native thread must not outlive what it reads
        if self._felt is not None:
            self._reader.attach(self._felt.runner)
        return notes

    def _topics(self) -> tuple[str, dict[str, str]]:
        end = time.monotonic() + self._discovery
        while True:
            known = {
                name: kinds[0] for name, kinds in self._node.get_topic_names_and_types() if kinds
            }
            useful = {n: k for n, k in known.items() if k in (JOINT_STATE, WRENCH_STAMPED)}
            published = {n: k for n, k in useful.items() if self._others(n, known)}
            try:
                return choose_topics(published, self._robot.description, self._naming, self.name)
            except InputError as error:
                if time.monotonic() > end:
                    if not published:
                        where = f"{RANGE}={os.environ[RANGE]}"
                        raise InputError(
                            f"{self.name}: nobody publishes {JOINT_STATE} within "
                            f"{self._discovery:g} s (domain? discovery range? {where})"
                        ) from None
                    raise InputError("; ".join(error.problems[:-1])) from None
            time.sleep(SETTLE)

    def _others(self, topic: str, known: dict[str, str]) -> bool:
        """Whether somebody publishes a topic who is no node of Touchline."""

        def publishers(name: str) -> set[tuple[str, str]]:
            found = self._node.get_publishers_info_by_topic(name)
            return {(info.node_namespace, info.node_name) for info in found}

        felt = [name for name in known if name.endswith(FELT)]
        return bool(publishers(topic).difference(*(publishers(name) for name in felt)))

    def _unheard(self, topic: str) -> list[str]:
        """A line for each publisher whose QoS does not match: DDS delivers nothing of it.

        Raises:
            InputError: that is so for all of them.
        """
        best_effort = self._ros.qos.ReliabilityPolicy.BEST_EFFORT
        publishers = self._node.get_publishers_info_by_topic(topic)
        unheard = [
            f"{topic}: {_node(info)} publishes best effort, and reliable=1 cannot match"
            for info in publishers
            if self._reliable and info.qos_profile.reliability == best_effort
        ]
        if unheard and len(unheard) == len(publishers):
            raise InputError(f"{unheard[0]}; leave it out")
        return unheard

    def _subscribe(self, kind: Any, topic: str) -> Any:
        qos = self._ros.qos
        reliability = qos.ReliabilityPolicy
        profile = qos.QoSProfile(
            depth=self._depth,
            history=qos.HistoryPolicy.KEEP_LAST,
            reliability=reliability.RELIABLE if self._reliable else reliability.BEST_EFFORT,
        )
        return self._node.create_subscription(kind, topic, lambda message: None, profile)

    def attach(self, pipeline: Pipeline) -> None:
        """From now on the pipeline runs in a native thread, behind the one that takes messages."""
        self._felt = Felt(self._robot, pipeline)
        if self._reader is not None:
            self._reader.attach(self._felt.runner)

    def read(self, timeout: float) -> list[Sample]:
        """The samples that have come; with results where a pipeline is attached."""
        assert self._reader is not None
        if self._felt is not None:
            found = self._felt.read(timeout)
            self.streams[0].refused = self._felt.runner.refused
        else:
            self._reader.wait(timeout)
            found = [sample_of(numbers, self._robot) for numbers in self._reader.samples()]
        for stream, *came in self._reader.notes():
            self.streams[stream].receive(*came)
        if not self._complete:
            self._complete = self.streams[0].received > 0
            count, seen = self._reader.incomplete()
            if not self._complete and count >= INCOMPLETE:
                raise InputError(missing_joints(self._naming, seen))
        return found

    def close(self) -> None:
        """Leaves the graph."""
        if self._reader is not None:
            atexit.unregister(self.close)
            self._reader.stop()
            self._reader = None
        if self._node is not None:
            self._node.destroy_node()
            self._node = None
        if self._context is not None:
            self._ros.rclpy.shutdown(context=self._context)
            self._context = None


def _node(info: Any) -> str:
    """A publisher's node; DDS tells its name after its topics."""
    return "a node" if info.node_name == UNKNOWN_NODE else info.node_name


def make_reader(
    description: RobotDescription, naming: Naming, rcl: Rcl, subscriptions: list[int]
) -> core.TopicReader:
    """The native thread that takes messages of a robot and makes samples of them.

    Args:
        description: of the robot.
        naming: its names and factors in the messages.
        rcl: functions that take messages.
        subscriptions: as `rcl` knows them: of the joint states, then of each sensor.
    """
    axes = np.full((len(description.sensors), 6), np.nan)
    for k, sensor in enumerate(description.sensors):
        for axis, column in naming.sensors[sensor.name].items():
            axes[k, AXES.index(axis)] = column.factor
    return core.TopicReader(
        list(naming.joint_names),
        [[column.factor for column in naming.joints[s]] for s in ("q", "qd", "tau")],
        [joint.measured for joint in description.joints],
        axes.tolist(),
        rcl.take,
        rcl.set_on_new,
        subscriptions,
        SLOTS,
    )


def sample_of(numbers: np.ndarray, robot: Robot) -> Sample:
    """A sample of the numbers of the native thread."""
    n, k = len(robot.joint_names), len(robot.sensor_names)
    q, qd, tau, wrench, ages = np.split(numbers[3:], np.cumsum([n, n, n, 6 * k]))
    arrival, sequence, at = float(numbers[0]), int(numbers[1]), float(numbers[2])
    return Sample(at, q, qd, tau, wrench.reshape(k, 6), arrival, sequence, ages)


def missing_joints(naming: Naming, seen: list[str]) -> str:
    """What to say where no joint state names all joints; `seen` are the names in them."""
    missing = [name for name in naming.joint_names if name not in seen]
    if not missing:
        names = listing(naming.joint_names)
        return f"{naming.source}: no joint state names all of {names} at once"
    return (
        f"{naming.source}: the joint states have no joint '{missing[0]}'"
        f"{did_you_mean(missing[0], seen)}; they have {listing(seen)}; other names go under "
        "`log: joint_names`"
    )


class _Ros:
    """The parts of ROS 2 that are used, as they are found on this machine."""

    def __init__(self, source: str) -> None:
        try:
            import rclpy
            import rclpy.qos
            import rclpy.signals
            from geometry_msgs.msg import WrenchStamped
            from sensor_msgs.msg import JointState
        except (ModuleNotFoundError, ImportError) as error:
            raise InputError(
                f"{source}: ROS 2 is not there ({error.name}): source a ROS 2 installation, or "
                "pip install 'touchline[ros2]'"
            ) from None
        self.rclpy, self.qos = rclpy, rclpy.qos
        self.no_signals = rclpy.signals.SignalHandlerOptions.NO
        self.rcl = find_rcl()
        self.joint_state, self.wrench = JointState, WrenchStamped
