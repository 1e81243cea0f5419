# SPDX-License-Identifier: Apache-2.0
"""Writes rosbag2 recordings for tests."""

import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES = STORE.types
STORAGE = {"db3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}
JOINTS, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"


def header(stamp, frame="base"):
    seconds, rest = divmod(round(stamp * 1e9), 10**9)
    time = TYPES["builtin_interfaces/msg/Time"](sec=int(seconds), nanosec=int(rest))
    return TYPES["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def joint_state(stamp, names, q=(), qd=(), tau=(), frame="base"):
    values = {
        "position": np.array(q, float),
        "velocity": np.array(qd, float),
        "effort": np.array(tau, float),
    }
    return TYPES[JOINTS](header=header(stamp, frame), name=list(names), **values)


def wrench(stamp, values, frame="tool"):
    vector = TYPES["geometry_msgs/msg/Vector3"]
    parts = {
        "force": vector(*(float(x) for x in values[:3])),
        "torque": vector(*(float(x) for x in values[3:])),
    }
    body = TYPES["geometry_msgs/msg/Wrench"](**parts)
    return TYPES[WRENCH](header=header(stamp, frame), wrench=body)


def raw(message, kind):
    return bytes(STORE.serialize_cdr(message, kind))


def write_bag(folder, messages, kind="db3", silent=(), packed=None):
    """Write (topic, received [s], type, message); `silent` topics are announced, never written.

    `packed` compresses each "FILE" or "MESSAGE".
    """
    writer = Writer(folder, version=9, storage_plugin=STORAGE[kind])
    if packed is not None:
        writer.set_compression(CompressionMode[packed], CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, of_type in silent:
            writer.add_connection(topic, of_type, typestore=STORE)
        for topic, received, of_type, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, of_type, typestore=STORE)
            data = message if isinstance(message, bytes) else raw(message, of_type)
            writer.write(connections[topic], round(received * 1e9), data)
    return folder


def storage_file(folder, kind):
    return folder / f"{folder.name}.{kind}"
