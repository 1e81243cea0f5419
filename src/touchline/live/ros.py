# SPDX-License-Identifier: Apache-2.0
# pyright: reportMissingImports=false
"""`ros2://`: topics of joint states and wrenches, unsynchronised, matched by name."""

import os
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.errors import InputError
from touchline.live.loopback import RANGE, keep_local
from touchline.live.sample import Sample, stamp
from touchline.live.source import Address
from touchline.live.streams import Stream
from touchline.logs.cdr import JOINT_STATE, WRENCH_STAMPED
from touchline.logs.naming import Naming, parse_naming
from touchline.logs.topics import choose_topics
from touchline.model.description import AXES, RobotDescription
from touchline.model.robot import Robot
from touchline.suggest import did_you_mean, listing

Array = NDArray[np.float64]

DISCOVERY = 8.0  # s in which the topics have to appear: drivers start beside this program
SETTLE = 0.2  # s between two looks at the topics
DEPTH = 2000  # messages that wait for this program: two seconds at 1 kHz
MOST = 256  # messages of a topic that are taken at once
WRENCH_REACH = 3.0  # periods of a wrench's topic after which its last value is none any more
LONGEST_REACH = 0.1  # s of the same
AHEAD = 4096  # wrenches that wait for their joint state
INCOMPLETE = 20  # joint states without a joint, before the first whole one: it is not there
FELT = "/external_joint_torques"  # what Touchline's node publishes, as joint states too
CLOCK = 1.0  # s by which two topics' stamps may differ on one clock


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
        self._merge = Merge(robot.description, self._naming)
        self.streams = self._merge.streams
        self._node: Any = None
        self._subscriptions: list[tuple[Any, Callable[[Any], None]]] = []
        self._states: list[tuple[float, Sequence[str], Sequence[Any], float]] = []
        self._context: Any = None

    def open(self) -> list[str]:
        """Joins the graph, looks for the topics and subscribes."""
        ros, local = self._ros, keep_local()
        self._context = ros.rclpy.Context()
        ros.rclpy.init(context=self._context)
        self._node = ros.rclpy.create_node("touchline_live", context=self._context)
        self._executor = ros.executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        joints, wrenches = self._topics()
        names = {joints: "joints"} | {topic: sensor for sensor, topic in wrenches.items()}
        notes = [local] if local else []
        notes += [f"{names[topic]}: {topic}" for topic in names]
        notes += [w for topic in names for w in self._qos_warnings(topic)]
        self._subscribe(ros.joint_state, joints, self._on_joints)
        for k, sensor in enumerate(self._robot.sensor_names):
            self._subscribe(ros.wrench, wrenches[sensor], self._wrench_of(k))
        return notes

    def _topics(self) -> tuple[str, dict[str, str]]:
        end = time.monotonic() + self._discovery
        while True:
            self._executor.spin_once(timeout_sec=0.05)
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

    def _qos_warnings(self, topic: str) -> list[str]:
        best_effort = self._ros.qos.ReliabilityPolicy.BEST_EFFORT
        return [
            f"{topic}: {info.node_name} publishes best effort, and reliable=1 cannot match"
            for info in self._node.get_publishers_info_by_topic(topic)
            if self._reliable and info.qos_profile.reliability == best_effort
        ]

    def _subscribe(self, kind: Any, topic: str, callback: Callable[[Any], None]) -> None:
        qos = self._ros.qos
        reliability = qos.ReliabilityPolicy
        profile = qos.QoSProfile(
            depth=self._depth,
            history=qos.HistoryPolicy.KEEP_LAST,
            reliability=reliability.RELIABLE if self._reliable else reliability.BEST_EFFORT,
        )
        subscription = self._node.create_subscription(kind, topic, callback, profile)
        self._subscriptions.append((subscription, callback))

    def _on_joints(self, message: Any) -> None:
        signals = (message.position, message.velocity, message.effort)
        self._states.append((_stamp(message), message.name, signals, time.monotonic()))

    def _wrench_of(self, k: int) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            force, torque = message.wrench.force, message.wrench.torque
            values = (force.x, force.y, force.z, torque.x, torque.y, torque.z)
            self._merge.wrench(k, _stamp(message), values, time.monotonic())

        return take

    def read(self, timeout: float) -> list[Sample]:
        """The samples that have come."""
        end = time.monotonic() + timeout
        while True:
            self._executor.spin_once(timeout_sec=max(end - time.monotonic(), 0.0))
            # Joint states first: the wrenches that belong to them have come by then.
            for subscription, callback in self._subscriptions:
                self._drain(subscription, callback)
            states, self._states = self._states, []
            merged = (self._merge.joints(*state) for state in states)
            found = [sample for sample in merged if sample is not None]
            if found or time.monotonic() >= end:
                return found

    @staticmethod
    def _drain(subscription: Any, callback: Callable[[Any], None]) -> None:
        """Takes what waits, past the executor, which needs ten times as long for a message."""
        with subscription.handle:
            for _ in range(MOST):
                taken = subscription.handle.take_message(subscription.msg_type, False)
                if taken is None:
                    return
                callback(taken[0])

    def close(self) -> None:
        """Leaves the graph."""
        if self._node is not None:
            self._executor.remove_node(self._node)
            self._node.destroy_node()
            self._executor.shutdown()
            self._subscriptions.clear()
            self._node = None
        if self._context is not None:
            self._ros.rclpy.shutdown(context=self._context)
            self._context = None


def _stamp(message: Any) -> float:
    """The header's stamp [s]; that of now where it is zero."""
    at = message.header.stamp
    if at.sec == 0 and at.nanosec == 0:
        return stamp(time.time_ns())
    return at.sec + at.nanosec * 1e-9


class _Ros:
    """The parts of ROS 2 that are used, as they are found on this machine."""

    def __init__(self, source: str) -> None:
        try:
            import rclpy
            import rclpy.executors
            import rclpy.qos
            from geometry_msgs.msg import WrenchStamped
            from sensor_msgs.msg import JointState
        except (ModuleNotFoundError, ImportError) as error:
            raise InputError(
                f"{source}: ROS 2 is not there ({error.name}): source a ROS 2 installation, or "
                "pip install 'touchline[ros2]'"
            ) from None
        self.rclpy, self.executors, self.qos = rclpy, rclpy.executors, rclpy.qos
        self.joint_state, self.wrench = JointState, WrenchStamped


class Merge:
    """Makes samples of joint states and wrenches that come one after the other, without ROS.

    Args:
        description: of the robot.
        naming: its names and factors in the messages.

    Attributes:
        streams: the joint states, then one for each sensor.
    """

    def __init__(self, description: RobotDescription, naming: Naming) -> None:
        self._names = naming.joint_names
        self._order: dict[tuple[str, ...], list[int] | None] = {}
        self._source = naming.source
        signals = ("q", "qd", "tau")
        self._factors = [np.array([c.factor for c in naming.joints[s]]) for s in signals]
        self._unused = [j for j, x in enumerate(description.joints) if not x.measured]
        self._axes = np.full((len(description.sensors), 6), np.nan)
        for k, sensor in enumerate(description.sensors):
            for axis, column in naming.sensors[sensor.name].items():
                self._axes[k, AXES.index(axis)] = column.factor
        self._wrenches = np.full_like(self._axes, np.nan)
        self._stamps = np.full(len(description.sensors), -np.inf)
        # Wrenches that are newer than the last joint state.
        self._coming: list[deque[tuple[float, Array]]] = [
            deque(maxlen=AHEAD) for _ in description.sensors
        ]
        self.streams = (Stream("joints"), *(Stream(s.name) for s in description.sensors))
        self._sequence = -1
        self._without = 0  # joint states that did not name all joints, before the first that did
        self._seen: dict[str, None] = {}

    def wrench(self, k: int, at: float, values: Sequence[float], arrival: float) -> None:
        """A wrench of sensor `k` (6,), stamped `at` [s]."""
        measured = np.array(values) * self._axes[k]
        has = np.isfinite(self._axes[k])
        self.streams[1 + k].receive(at, arrival, bool(np.isfinite(measured[has]).all()))
        coming = self._coming[k]
        last = coming[-1][0] if coming else self._stamps[k]
        if at < last - CLOCK:  # the clock was set back
            coming.clear()
            self._stamps[k] = -np.inf
        if at > last or at < last - CLOCK:
            coming.append((at, measured))

    def joints(
        self, at: float, names: Sequence[str], signals: Sequence[Any], arrival: float
    ) -> Sample | None:
        """A joint state stamped `at` [s]; None where it does not name all joints.

        Raises:
            InputError: the first joint states together lack a joint.
        """
        order = self._order_of(tuple(names))
        if order is None:
            return None
        q, qd, tau = (
            self._picked(values, len(names), order) * factors
            for values, factors in zip(signals, self._factors, strict=True)
        )
        tau[self._unused] = np.nan
        self._sequence += 1
        self.streams[0].receive(at, arrival, bool(np.isfinite(q).all()))
        for k, coming in enumerate(self._coming):
            if at < self._stamps[k] - CLOCK:
                self._stamps[k] = -np.inf
            while coming and coming[0][0] <= at:
                self._stamps[k], self._wrenches[k] = coming.popleft()
        ages = at - self._stamps
        wrench = self._wrenches.copy()
        wrench[~self._is_near(ages)] = np.nan
        return Sample(at, q, qd, tau, wrench, arrival, self._sequence, ages)

    def _is_near(self, ages: Array) -> NDArray[np.bool_]:
        periods = np.array([stream.period or 0.0 for stream in self.streams[1:]])
        reach = np.clip(WRENCH_REACH * np.maximum(periods, self._period), 0.01, LONGEST_REACH)
        return np.abs(ages) <= reach

    @property
    def _period(self) -> float:
        return self.streams[0].period or 0.0

    @staticmethod
    def _picked(values: Any, count: int, order: list[int]) -> Array:
        if len(values) != count:
            return np.full(len(order), np.nan)
        return np.asarray(values, dtype=float)[order]

    def _order_of(self, names: tuple[str, ...]) -> list[int] | None:
        """Where the robot's joints stand in a message; None where one is missing."""
        if names not in self._order:
            if len(self._order) > 64:
                self._order.clear()
            whole = set(self._names) <= set(names)
            self._order[names] = [names.index(n) for n in self._names] if whole else None
            self._seen |= dict.fromkeys(names)
        order = self._order[names]
        if order is None and self._sequence < 0:
            self._without += 1
            if self._without >= INCOMPLETE:
                raise InputError(self._missing())
        return order

    def _missing(self) -> str:
        seen = list(self._seen)
        missing = [name for name in self._names if name not in seen]
        if not missing:
            return f"{self._source}: no joint state names all of {listing(self._names)} at once"
        return (
            f"{self._source}: the joint states have no joint '{missing[0]}'"
            f"{did_you_mean(missing[0], seen)}; they have {listing(seen)}; other names go under "
            "`log: joint_names`"
        )
