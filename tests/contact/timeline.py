# SPDX-License-Identifier: Apache-2.0
"""Pushes that move and change over time, and what the pipeline makes of them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchline.localizer.skin import Skin
from touchline.model.robot import Robot
from touchline.pipeline.pipeline import Pipeline
from touchline.trials.touches import Signals, add_noise, resting_signals, touch_loads

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Push:
    """A push whose place and force on a link (both in its frame) are functions of time [s]."""

    link: str
    place: Callable[[float], Array]
    force: Callable[[float], Array]


def ramp(time: float, begin: float, rise: float = 0.02) -> float:
    """From 0 before `begin` to 1 after `rise` [s]."""
    return float(np.clip((time - begin) / rise, 0.0, 1.0))


def signals(
    robot: Robot, q: Array, pushes: list[Push], duration: float, seed: int | None
) -> Signals:
    """What the sensors of an arm at rest report at 1 kHz; `seed` None: without noise."""
    exact = resting_signals(robot, q, [], duration, None)
    poses, n = robot.T_world_links(q), len(robot.joint_names)
    nodes = {patch.link: patch.node for patch in Skin(robot).patches}
    for i, time in enumerate(exact.time.tolist()):
        for push in pushes:
            force = poses[push.link][:3, :3] @ push.force(time)
            if not force.any():
                continue
            loads = touch_loads(robot, q, nodes[push.link], where(robot, q, push, time), force)
            exact.tau[i] -= loads[:n]
            exact.wrench[i] -= loads[n:].reshape(-1, 6)
    return add_noise(robot, exact, None if seed is None else np.random.default_rng(seed))


def where(robot: Robot, q: Array, push: Push, time: float) -> Array:
    """The place (3,) [m] of a push in world."""
    T = robot.T_world_links(q)[push.link]
    return T[:3, :3] @ push.place(time) + T[:3, 3]


def follow(
    robot: Robot, q: Array, pushes: list[Push], duration: float, seed: int | None = None
) -> Pipeline:
    """A pipeline that has felt pushes."""
    s = signals(robot, q, pushes, duration, seed)
    pipeline = Pipeline(robot, torque_error=0.0)
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    return pipeline


def contacts_at(pipeline: Pipeline, time: float) -> dict[int, dict]:
    """What is said at a time, by the id of the event."""
    table, columns = pipeline.contacts, pipeline.contacts.columns()
    rows = np.flatnonzero(table.sample == round(time * 1e3))
    return {
        int(table.event[i]): {
            "link": columns["link"][i],
            "status": columns["status"][i],
            "position": np.array([columns[axis][i] for axis in "xyz"], float),
            "force": np.array([columns[axis][i] for axis in ("fx", "fy", "fz")], float),
            "std": columns["position_std"][i],
        }
        for i in rows
    }
