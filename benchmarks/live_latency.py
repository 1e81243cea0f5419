# SPDX-License-Identifier: Apache-2.0
"""From a topic's publication to what is felt, beside its bare delivery by rclpy, in one run.

python benchmarks/live_latency.py [SECONDS] [RATE] [wrenches | torques]

With `wrenches` (the default) the arm has torques and three force-torque sensors, each a topic of
its own; with `torques` it has joint torques alone, and each contact is searched for everywhere.

Three processes on this machine: an arm that publishes a motion with touches, the node, and this
listener. All times are from the stamp that the arm gives a joint state when it publishes it. Of
the joint states that were published those are counted that the node's pipeline took. Needs
touchline[ros2].
"""

import os
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

os.environ.setdefault("ROS_DOMAIN_ID", "91")
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

ARM = """
import sys, time
import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
import touchline as tl
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import demo
from touchline.simulation.scene import Run
robot, rate, seconds = tl.load_robot(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])
s = demo(robot, 20.0, Run(noise=SensorNoise(), rate=rate)).samples
rclpy.init()
node = rclpy.create_node("arm")
out = node.create_publisher(JointState, "/joint_states", qos_profile_sensor_data)
sensors = [
    (node.create_publisher(WrenchStamped, f"/{name}/wrench", qos_profile_sensor_data), values)
    for name, values in zip(robot.sensor_names, s.wrench.transpose(1, 0, 2).tolist())
]
load = WrenchStamped()
message = JointState(name=list(robot.joint_names))
rows = [[x.tolist() for x in row] for row in zip(s.q, s.qd, s.tau)]
while out.get_subscription_count() < 2:  # the node and the listener
    time.sleep(0.01)
time.sleep(0.5)
begin = time.monotonic()
for i in range(int(rate * seconds)):
    message.position, message.velocity, message.effort = rows[i % len(rows)]
    while (wait := begin + i / rate - time.monotonic()) > 0:
        time.sleep(wait)
    seconds_, rest = divmod(time.time_ns(), 10**9)
    load.header.stamp = message.header.stamp
    message.header.stamp.sec, message.header.stamp.nanosec = seconds_, rest
    for publisher, values in sensors:
        force, torque = load.wrench.force, load.wrench.torque
        force.x, force.y, force.z, torque.x, torque.y, torque.z = values[i % len(rows)]
        publisher.publish(load)
    out.publish(message)
print(int(rate * seconds), flush=True)
sys.stdin.read()
"""
STAMP, ENCAPSULATION = struct.Struct("<iI"), 4  # of a message's header, behind so many bytes
TIME, NOTHING = b'"time": ', b'"contacts": []'
DRAIN = 3.0  # s in which what was published last is counted
START = 1.0  # s: the samples of the start wait until the arm has been looked at
TORQUES = """name: sara-joints
model: {model}
joints: [{joints}]
"""
TOPICS = (
    "log: {topics: {wrench: {base: /base/wrench, wrist: /wrist/wrench, handle: /handle/wrench}}}"
)


def main() -> None:
    """Prints p50, p99 and the largest delay of both."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 30.0
    rate = float(sys.argv[2]) if len(sys.argv) > 2 else 1000.0
    with tempfile.TemporaryDirectory() as folder:
        robot = _robot(Path(folder), "torques" not in sys.argv[3:])
        alone = _alone(str(robot), rate)
        arm = [sys.executable, "-c", ARM, str(robot), str(rate), str(seconds)]
        parameters = ["-p", f"robot:={robot}", "-p", "source:=ros2://?wait=60", "-p", "force:=true"]
        node = [sys.executable, "-m", "touchline.live.node", "--ros-args", *parameters]
        pipe = subprocess.PIPE
        with subprocess.Popen(arm, stdin=pipe, stdout=pipe, text=True) as publishes:
            with subprocess.Popen(node, stderr=subprocess.DEVNULL) as feels:
                try:
                    delays, taken = _listen(seconds)
                    if feels.poll() is not None:
                        raise SystemExit(f"the node has ended with status {feels.returncode}")
                    assert publishes.stdout is not None
                    published = publishes.stdout.readline().strip()
                finally:
                    feels.terminate()
                    publishes.terminate()
    print(f"{published} joint states published, {taken} taken by the pipeline")
    for name, found in delays.items():
        if not found:
            print(f"{name}: nothing came")
            continue
        at, late = np.array(found).T
        p50, p99 = np.percentile(late, [50, 99])
        later = late[at > at[0] + START].max(initial=0.0)
        print(
            f"{name}: {len(found)} messages, p50 {p50:.2f} ms, p99 {p99:.2f} ms, "
            f"largest {late.max():.1f} ms, {later:.1f} ms after the first second"
        )
    p50, p99 = np.percentile(alone, [50, 99])
    print(f"the pipeline alone, samples with a contact: p50 {p50:.2f} ms, p99 {p99:.2f} ms")
    print(f"load of this machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


def _robot(folder: Path, wrenches: bool) -> Path:
    import touchline as tl

    path = folder / "robot.yaml"
    sara = tl.load_robot("sara-full").description
    assert sara.path is not None
    if wrenches:
        path.write_text(sara.path.read_text() + TOPICS)
        return path
    joints = ", ".join(f"{{name: {joint.name}, torque: sensor}}" for joint in sara.joints)
    path.write_text(TORQUES.format(model=sara.model, joints=joints))
    return path


def _alone(path: str, rate: float) -> list[float]:
    """What the pipeline itself takes for each sample of the motion that has a contact [ms]."""
    import touchline as tl
    from touchline.simulation.noise import SensorNoise
    from touchline.simulation.scenario import demo
    from touchline.simulation.scene import Run

    robot = tl.load_robot(path)
    s = demo(robot, 20.0, Run(noise=SensorNoise(), rate=rate)).samples
    pipeline, took = tl.Pipeline(robot, period=1.0 / rate), []
    for row in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
        begin = time.perf_counter()
        result = pipeline.update(*row)
        if result.contacts:
            took.append(1e3 * (time.perf_counter() - begin))
    return took


def _listen(seconds: float) -> tuple[dict[str, list[tuple[float, float]]], str]:
    """When each message came [s], how late [ms]; how many joint states the node has received."""
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import JointState
    from std_msgs.msg import String

    rclpy.init()
    listener = rclpy.create_node("listener")
    delays: dict[str, list[tuple[float, float]]] = {
        "bare delivery": [],
        "felt": [],
        "a contact": [],
    }

    def note(name: str):
        def take(message: bytes) -> None:
            now = time.time_ns()
            seconds_, rest = STAMP.unpack_from(message, ENCAPSULATION)
            delays[name].append((now * 1e-9, (now - seconds_ * 10**9 - rest) * 1e-6))

        return take

    def contacts(message: bytes) -> None:
        now = time.time_ns() * 1e-9
        if NOTHING not in message[-len(NOTHING) - 8 :]:
            begin = message.index(TIME) + len(TIME)
            felt = float(message[begin : message.index(b",", begin)])
            delays["a contact"].append((now, 1e3 * (now - felt)))

    # As bytes: this listener has three messages a millisecond, and what it takes for them counts.
    def listen(kind, topic: str, take) -> None:
        listener.create_subscription(kind, topic, take, qos_profile_sensor_data, raw=True)

    topics = {"bare delivery": "/joint_states", "felt": "/touchline/external_joint_torques"}
    for name, topic in topics.items():
        listen(JointState, topic, note(name))
    listen(String, "/touchline/contacts", contacts)
    facts: dict[str, str] = {}

    def diagnose(message: DiagnosticArray) -> None:
        facts.update((pair.key, pair.value) for pair in message.status[0].values)

    listener.create_subscription(DiagnosticArray, "/diagnostics", diagnose, 10)
    end = time.monotonic() + 60.0
    while not delays["felt"] and time.monotonic() < end:
        rclpy.spin_once(listener, timeout_sec=0.1)
    end = time.monotonic() + seconds + DRAIN
    while time.monotonic() < end:
        rclpy.spin_once(listener, timeout_sec=0.1)
    return delays, facts.get("received", "none")


if __name__ == "__main__":
    main()
