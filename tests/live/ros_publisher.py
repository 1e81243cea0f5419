# SPDX-License-Identifier: Apache-2.0
"""A process that publishes a robot's topics: `python ros_publisher.py ROBOT SECONDS [OPTION ...]`.

Joint states at 500 Hz with an extra joint and in another order; wrenches of `wrist` at 500 Hz from
another stamp. Options: push (every 4 s), nowrench (the topic is silent in every other second
from 4 s on), gone (the joints are so), names (another joint is published), marks (prints when a
silence begins and ends).
"""

import sys
import time

import rclpy
from geometry_msgs.msg import WrenchStamped
from live_arms import pushed
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from touchline.model.robot import load_robot

RATE = 500.0


def main():
    robot, seconds, options = load_robot(sys.argv[1]), float(sys.argv[2]), sys.argv[3:]
    push = {"begin": 2.5} if "push" in options else {"begin": 1e3}
    samples = pushed(robot, seconds=4.0, rate=RATE, **push)
    rclpy.init()
    node = rclpy.create_node("arm")
    profile = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    joints = node.create_publisher(JointState, "/joint_states", profile)
    wrench = node.create_publisher(WrenchStamped, "/ft/wrist", profile)
    names = list(robot.joint_names)
    if "names" in options:
        names[0] = "shoulder"
    order = list(range(len(names)))[::-1]
    state = JointState(name=[*(names[i] for i in order), "finger"])
    load = WrenchStamped()
    print("ready", flush=True)
    was_quiet = False
    origin, begin = time.time(), time.monotonic()
    for i in range(int(seconds * RATE)):
        due = begin + i / RATE
        while (wait := due - time.monotonic()) > 0:
            time.sleep(wait)
        at, row = origin + i / RATE, i % len(samples)
        quiet = i / RATE > 4.0 and (i / RATE) % 2.0 > 1.5
        if quiet != was_quiet and "marks" in options:
            print("silent" if quiet else "speaks", time.monotonic(), flush=True)
        was_quiet = quiet
        if not ("gone" in options and quiet):
            state.header.stamp.sec, state.header.stamp.nanosec = int(at), int(at % 1 * 1e9)
            for name, values in zip(
                ("position", "velocity", "effort"),
                (samples.q[row], samples.qd[row], samples.tau[row]),
                strict=True,
            ):
                setattr(state, name, [*(float(values[k]) for k in order), 0.0])
            joints.publish(state)
        if not ("nowrench" in options and quiet):
            late = at - 0.0007
            load.header.stamp.sec, load.header.stamp.nanosec = int(late), int(late % 1 * 1e9)
            force, torque = load.wrench.force, load.wrench.torque
            force.x, force.y, force.z, torque.x, torque.y, torque.z = samples.wrench[
                row, 0
            ].tolist()
            wrench.publish(load)
    node.destroy_node()
    rclpy.shutdown()


main()
