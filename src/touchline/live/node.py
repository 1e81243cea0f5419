# SPDX-License-Identifier: Apache-2.0
# pyright: reportMissingImports=false
"""A ROS 2 lifecycle node that feels with a running robot and publishes what it feels.

    python -m touchline.live.node --ros-args -p robot:=robot.yaml -p source:=ros2://

Publishes `~/external_joint_torques`, `~/SEGMENT/wrench`, `~/contacts`, `~/collision`,
`~/markers`, `/diagnostics` and, of a robot with an `interface`, `~/touch`; offers `~/reset`,
`~/tare` and `~/set_load`. It commands nothing.
"""

import gc
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from touchline.errors import InputError
from touchline.live.aside import settle
from touchline.live.connection import Connection
from touchline.live.loopback import keep_local
from touchline.live.messages import TOUCH, Messages
from touchline.live.rcl import find_rcl
from touchline.live.session import EventNews, Session
from touchline.live.sources import make_source
from touchline.live.streams import StreamState
from touchline.model.robot import load_robot

DIAGNOSTICS = 1.0  # s between two of them
IDLE = 0.05  # s that an inactive node waits for requests
REQUESTS = 0.05  # s between two looks of an active one: each costs as much as a sample
MARKERS = 0.03  # s between two looks of a viewer
MISSING = "ROS 2 is not there ({}): source a ROS 2 installation, or pip install 'touchline[ros2]'"


def _ros() -> Any:
    """The parts of ROS 2 that are used."""
    try:
        import rclpy
        import rclpy.executors
        import rclpy.lifecycle
        import rclpy.parameter
        import rclpy.qos
    except ImportError as error:
        raise InputError(MISSING.format(error.name)) from None
    return rclpy


class TouchlineNode:
    """The node; `spin` runs it.

    Args:
        context: of rclpy, initialised.
        name: of the node.

    Attributes:
        node: the rclpy lifecycle node.
        session: while it is active.
    """

    def __init__(self, context: Any, name: str = "touchline") -> None:
        self._rclpy = _ros()
        lifecycle = self._rclpy.lifecycle
        outer = self

        class Node(lifecycle.LifecycleNode):
            def on_configure(self, state):
                return outer._transition(outer._configure)

            def on_activate(self, state):
                done = super().on_activate(state)
                return outer._transition(outer._activate) if _succeeded(done) else done

            def on_deactivate(self, state):
                outer._end()
                return super().on_deactivate(state)

            def on_cleanup(self, state):
                outer._clean()
                return lifecycle.TransitionCallbackReturn.SUCCESS

            def on_shutdown(self, state):
                outer._clean()
                return lifecycle.TransitionCallbackReturn.SUCCESS

        def _succeeded(result: Any) -> bool:
            return result == lifecycle.TransitionCallbackReturn.SUCCESS

        self.node: Any = Node(name, context=context)
        self.session: Session | None = None
        self._news: Iterator[EventNews] | None = None
        self._publishers: dict[str, Any] = {}
        self._collision: bool | None = None
        self._told, self._drawn, self._asked = 0.0, 0.0, 0.0
        self._writer: Any = None
        self._declare()
        self._executor = self._rclpy.executors.SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)

    def _declare(self) -> None:
        from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

        def declare(name: str, value: Any, text: str, fixed: bool = True, **ranges: Any) -> None:
            descriptor = ParameterDescriptor(description=text, read_only=fixed, **ranges)
            self.node.declare_parameter(name, value, descriptor)

        rate = FloatingPointRange(from_value=1.0, to_value=1000.0, step=0.0)
        depth = IntegerRange(from_value=1, to_value=1000, step=1)
        declare("robot", "", "robot.yaml, or the name of a robot that ships with Touchline")
        declare("autostart", True, "whether it configures and activates itself")
        declare("source", "ros2://", "as `touchline live --source` takes it")
        declare("record", "", "a .mcap or .parquet for every sample; empty: none")
        declare("events", "", "a file for each event that is over, as a line of JSON; empty: none")
        declare("force", False, "go live whatever the first second looks like")
        declare("depth", 10, "of the publishers' history", integer_range=[depth])
        declare("reliable", True, "whether what is published is reliable")
        declare("frame", "world", "of what is published in world axes")
        declare("load_link", "", "that ~/set_load is about", False)
        declare("load_mass", -1.0, "[kg] of ~/set_load; 0: none; negative: weighed", False)
        declare("load_com", [0.0, 0.0, 0.0], "[m] of ~/set_load, in the link's frame", False)
        text = "largest rate at which results are published [Hz]"
        declare("publish_rate", 1000.0, text, False, floating_point_range=[rate])

    def _value(self, name: str) -> Any:
        return self.node.get_parameter(name).value

    def _transition(self, step: Any) -> Any:
        """A step of the lifecycle; bad input is logged and fails it."""
        results = self._rclpy.lifecycle.TransitionCallbackReturn
        try:
            step()
        except InputError as error:
            for problem in error.problems:
                self.node.get_logger().error(problem)
            self._end()
            return results.FAILURE
        return results.SUCCESS

    def _configure(self) -> None:
        if not self._value("robot"):
            raise InputError("parameter robot: give a robot.yaml or the name of a robot")
        self._clean()
        self._robot = load_robot(self._value("robot"))
        make_source(self._value("source"), self._robot)  # its address, before it is opened
        self._messages = Messages(self._robot, self._value("frame"))
        self._make_publishers()
        self._make_services()

    def _make_publishers(self) -> None:
        qos = self._rclpy.qos
        reliable = qos.ReliabilityPolicy.RELIABLE if self._value("reliable") else None
        profile = qos.QoSProfile(
            depth=self._value("depth"),
            history=qos.HistoryPolicy.KEEP_LAST,
            reliability=reliable or qos.ReliabilityPolicy.BEST_EFFORT,
        )
        latched = qos.QoSProfile(
            depth=1,
            reliability=qos.ReliabilityPolicy.RELIABLE,
            durability=qos.DurabilityPolicy.TRANSIENT_LOCAL,
        )
        for name, kind in self._messages.kinds().items():
            own = latched if name == "~/collision" else profile
            make = self.node.create_lifecycle_publisher
            self._publishers[name] = make(kind, name, own)

    def _write(self, session: Session) -> None:
        """From now on the thread that feels publishes, behind the samples of the start."""
        assert session.pipeline is not None
        self._writer = session.pipeline.writer(
            lambda robot: self._messages.writer(robot, find_rcl(), self._publishers)
        )
        self._writer.set_rate(self._value("publish_rate"))

    def _make_services(self) -> None:
        from std_srvs.srv import Trigger

        self._services = [
            self.node.create_service(Trigger, f"~/{name}", getattr(self, f"_on_{name}"))
            for name in ("reset", "tare", "set_load")
        ]

    def _on_reset(self, request: Any, response: Any) -> Any:
        """The estimate starts anew; a collision that was latched is cleared."""
        self._publish_collision(False)
        return self._ask(response, lambda session: session.reset())

    def _on_tare(self, request: Any, response: Any) -> Any:
        return self._ask(response, lambda session: session.tare())

    def _on_set_load(self, request: Any, response: Any) -> Any:
        """From now on that is carried which `load_link`, `load_mass` and `load_com` say."""
        link, mass = self._value("load_link"), self._value("load_mass")
        if not link:
            response.success, response.message = False, "parameter load_link: give a link's name"
            return response
        com = list(self._value("load_com"))
        weighed = None if mass < 0.0 else mass
        return self._ask(response, lambda session: session.set_load(link, weighed, com))

    def _ask(self, response: Any, act: Callable[[Session], str]) -> Any:
        if self.session is None or self.session.pipeline is None:
            response.success, response.message = False, "the node is not active"
            return response
        try:
            response.success, response.message = True, act(self.session)
        except InputError as error:
            response.success, response.message = False, str(error)
        return response

    def _activate(self) -> None:
        source = make_source(self._value("source"), self._robot)
        record, events = self._value("record"), self._value("events")
        self.session = Session(
            self._robot,
            Connection(source),
            Path(record) if record else None,
            self._value("force"),
            Path(events) if events else None,
        )
        for reason in self.session.start():
            self.node.get_logger().warning(f"forced, in spite of {reason}")
        for note in self.session.connection.notes:
            self.node.get_logger().info(note)
        self._news = self.session.run()
        self._publish_collision(False)

    def _end(self) -> None:
        if self._news is not None:
            self._news.close()  # type: ignore[attr-defined]
            self._news = None
        if self.session is not None and self.session.pipeline is not None:
            self.session.pipeline.writer(None)  # its publishers may end before its thread does
        self._writer = None
        if self.session is not None:
            self.session.close()
            self.session = None

    def _clean(self) -> None:
        self._end()
        for publisher in self._publishers.values():
            self.node.destroy_publisher(publisher)
        for service in getattr(self, "_services", []):
            self.node.destroy_service(service)
        self._publishers, self._services = {}, []

    def step(self) -> None:
        """Answers requests; while active, reads the robot once and publishes."""
        now = time.monotonic()
        if self._news is None or now - self._asked >= REQUESTS:
            self._asked = now
            self._executor.spin_once(timeout_sec=IDLE if self._news is None else 0.0)
        if self._news is None or self.session is None:
            return
        try:
            news = next(self._news, None)
        except InputError as error:
            for problem in error.problems:
                self.node.get_logger().error(problem)
            news = None
        if news is None:
            self._diagnose()
            self.node.get_logger().info("the source has ended")
            self._end()
            return
        if self._writer is None:
            self._write(self.session)
        self._publish(self.session, news)

    def _publish(self, session: Session, news: EventNews) -> None:
        for notice in session.notices():
            if notice.state is StreamState.OK:
                self.node.get_logger().info(notice.text)
            else:
                self.node.get_logger().warning(notice.text)
        if any(event.level == "collision" for event in news.began):
            self._publish_collision(True)
        for touch in news.touches:
            self._publishers[TOUCH].publish(self._messages.touch(touch))
        result, sample = session.result, session.sample
        now = time.monotonic()
        if now - self._told >= DIAGNOSTICS:
            self._diagnose()
        if result is None or sample is None:
            return
        if any(contact.level == "collision" for contact in result.contacts):
            self._publish_collision(True)
        if now - self._drawn < MARKERS and not (news.began or news.ended):
            return
        self._drawn = now
        self._writer.set_rate(self._value("publish_rate"))
        markers = self._messages.markers(sample, result)
        if markers is not None:
            self._publishers["~/markers"].publish(markers)

    def _publish_collision(self, collision: bool) -> None:
        if collision != self._collision and "~/collision" in self._publishers:
            self._collision = collision
            self._publishers["~/collision"].publish(self._messages.collision(collision))

    def _diagnose(self) -> None:
        self._told = time.monotonic()
        if self.session is not None:
            stamp = self.node.get_clock().now().to_msg()
            message = self._messages.diagnostics(self.session, stamp, self.node.get_name())
            self._publishers["/diagnostics"].publish(message)

    def autostart(self) -> bool:
        """Configures and activates; whether both went well."""
        results = self._rclpy.lifecycle.TransitionCallbackReturn
        return (
            self.node.trigger_configure() == results.SUCCESS
            and self.node.trigger_activate() == results.SUCCESS
        )

    def spin(self, context: Any) -> None:
        """Runs until the context is shut down."""
        while self._rclpy.ok(context=context):
            self.step()

    def close(self) -> None:
        """Ends the session and the node."""
        self._clean()
        self._executor.remove_node(self.node)
        self.node.destroy_node()


def main(arguments: list[str] | None = None) -> int:
    """Runs the node; with `-p autostart:=false` it waits for its lifecycle's transitions."""
    try:
        rclpy = _ros()
    except InputError as error:
        print(f"touchline: {error}", file=sys.stderr)
        return 2
    local = keep_local()
    context = rclpy.Context()
    rclpy.init(args=sys.argv if arguments is None else arguments, context=context)
    node = TouchlineNode(context)
    if local:
        node.node.get_logger().info(local)
    start = node.node.get_parameter("autostart").value
    try:
        if start and not node.autostart():
            return 2
        settle()
        node.spin(context)
    except KeyboardInterrupt:
        pass
    finally:
        node.close()
        rclpy.try_shutdown(context=context)
        gc.unfreeze()
    return 0


if __name__ == "__main__":
    sys.exit(main())
