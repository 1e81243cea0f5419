# SPDX-License-Identifier: Apache-2.0
"""A process that listens to the node and prints what it heard as JSON: SECONDS [reset]."""

import json
import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

KINDS = {
    "/touchline/external_joint_torques": JointState,
    "/touchline/base/wrench": WrenchStamped,
    "/touchline/wrist/wrench": WrenchStamped,
    "/touchline/contacts": String,
    "/touchline/touch": String,
    "/touchline/collision": Bool,
    "/touchline/markers": MarkerArray,
    "/diagnostics": DiagnosticArray,
}


def main():
    heard = {topic: 0 for topic in KINDS}
    last, links, shapes, touches = {}, set(), set(), set()
    rclpy.init()
    node = rclpy.create_node("listener")

    def hear(topic):
        def take(message):
            heard[topic] += 1
            last[topic] = message
            if topic == "/touchline/contacts":
                links.update(c["link"] for c in json.loads(message.data)["contacts"])
            if topic == "/touchline/touch":
                touches.add(json.loads(message.data)["kind"])
            if topic == "/touchline/markers":
                shapes.update(marker.ns for marker in message.markers)

        return take

    for topic, kind in KINDS.items():
        durability = DurabilityPolicy.VOLATILE
        if topic == "/touchline/collision":
            durability = DurabilityPolicy.TRANSIENT_LOCAL
        node.create_subscription(
            kind, topic, hear(topic), QoSProfile(depth=100, durability=durability)
        )
    print("ready", flush=True)
    patience = time.monotonic() + 60.0  # until the node is there, on a busy machine
    while not heard["/touchline/contacts"] and time.monotonic() < patience:
        rclpy.spin_once(node, timeout_sec=0.1)
    end = time.monotonic() + float(sys.argv[1])
    patience = end + 60.0  # until the simulated arm was touched; it may run slower than the clock
    while time.monotonic() < (end if touches and "force" in shapes else patience):
        rclpy.spin_once(node, timeout_sec=0.1)
    answers = {}
    for name in ("reset", "tare", "set_load"):
        client = node.create_client(Trigger, f"/touchline/{name}")
        if client.wait_for_service(timeout_sec=5.0):
            future = client.call_async(Trigger.Request())
            rclpy.spin_until_future_complete(node, future, timeout_sec=10.0)
            answers[name] = [future.result().success, future.result().message]
    torques = last.get("/touchline/external_joint_torques")
    collision = last.get("/touchline/collision")
    status = last["/diagnostics"].status[0] if "/diagnostics" in last else None
    print(
        json.dumps(
            {
                "heard": heard,
                "touches": sorted(touches),
                "links": sorted(link for link in links if link),
                "shapes": sorted(shapes),
                "names": list(torques.name) if torques else [],
                "efforts": len(torques.effort) if torques else 0,
                "status": [status.name, status.message] if status else None,
                "facts": {pair.key: pair.value for pair in status.values} if status else {},
                "collision": collision.data if collision else None,
                "answers": answers,
            }
        )
    )


main()
