# SPDX-License-Identifier: Apache-2.0
"""Functions of rcl without ROS: messages wait in lists, and what is published is kept."""

import ctypes
import time
from collections import deque

import numpy as np
from rosbags.typesys import Stores, get_typestore

from touchline.live.rcl import Rcl, address

STORE = get_typestore(Stores.ROS2_HUMBLE)
JOINT_STATE, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
TAKEN, NOTHING, FAILED = 0, 401, 1


class Bytes(ctypes.Structure):
    """rcutils_uint8_array_t."""

    _fields_ = [
        ("buffer", ctypes.POINTER(ctypes.c_uint8)),
        ("length", ctypes.c_size_t),
        ("capacity", ctypes.c_size_t),
        ("allocator", ctypes.c_void_p * 5),
    ]


class Info(ctypes.Structure):
    """The beginning of rmw_message_info_t."""

    _fields_ = [
        ("source", ctypes.c_int64),
        ("received", ctypes.c_int64),
        ("published", ctypes.c_uint64),
        ("taken", ctypes.c_uint64),
        ("implementation", ctypes.c_void_p),
        ("publisher", ctypes.c_uint8 * 16),
    ]


ON_NEW = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_size_t)
SET_ON_NEW = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
TAKE = ctypes.CFUNCTYPE(
    ctypes.c_int,
    ctypes.c_void_p,
    ctypes.POINTER(Bytes),
    ctypes.POINTER(Info),
    ctypes.c_void_p,
)
PUBLISH = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(Bytes), ctypes.c_void_p)


class FakeRcl:
    """Topics by number, from 1; what is published to a number is kept in `published`."""

    def __init__(self):
        self._waiting, self._bells, self._count = {}, {}, {}
        self.published = []
        self._kept = (TAKE(self._take), SET_ON_NEW(self._set), PUBLISH(self._publish))
        self.rcl = Rcl(*(address(function) for function in self._kept))

    def _set(self, topic, callback, user):
        self._bells[topic] = (ON_NEW(callback), user) if callback else None
        return 0

    def _take(self, topic, out, info, _):
        if not self._waiting.get(topic):
            return NOTHING
        number, data = self._waiting[topic].popleft()
        assert len(data) <= out[0].capacity
        ctypes.memmove(out[0].buffer, data, len(data))
        out[0].length = len(data)
        info[0].published = number
        info[0].publisher[0] = 7
        return TAKEN

    def _publish(self, topic, message, _):
        data = bytes(message[0].buffer[: message[0].length])
        self.published.append((topic, data))
        return 0

    def send(self, topic, data, lost=0):
        """A message arrives, behind `lost` that did not."""
        self._count[topic] = self._count.get(topic, 0) + 1 + lost
        self._waiting.setdefault(topic, deque()).append((self._count[topic], data))
        bell = self._bells.get(topic)
        if bell:
            bell[0](bell[1], 1)


def _stamp(at):
    whole = int(np.floor(at))
    time_ = STORE.types["builtin_interfaces/msg/Time"](sec=whole, nanosec=round((at - whole) * 1e9))
    return STORE.types["std_msgs/msg/Header"](stamp=time_, frame_id="")


def joint_state(at, names, q, qd, tau):
    """As CDR."""
    message = STORE.types[JOINT_STATE](
        header=_stamp(at),
        name=list(names),
        position=np.array(q, dtype=float),
        velocity=np.array(qd, dtype=float),
        effort=np.array(tau, dtype=float),
    )
    return bytes(STORE.serialize_cdr(message, JOINT_STATE))


def wrench(at, values):
    """As CDR."""
    vector = STORE.types["geometry_msgs/msg/Vector3"]
    load = STORE.types["geometry_msgs/msg/Wrench"](
        force=vector(*map(float, values[:3])), torque=vector(*map(float, values[3:]))
    )
    message = STORE.types[WRENCH](header=_stamp(at), wrench=load)
    return bytes(STORE.serialize_cdr(message, WRENCH))


def until(condition, seconds=5.0):
    """Waits for a condition; its value."""
    end = time.monotonic() + seconds
    while not (found := condition()) and time.monotonic() < end:
        time.sleep(0.001)
    return found
