# SPDX-License-Identifier: Apache-2.0
"""What a robot can do about a contact: functions from a contact and a state to joint torques.

All torques are link-side torques (n,) [Nm or N]. With the inertia M, the torques `h` that keep the
velocity (weight, Coriolis, centrifugal) and a wanted joint velocity v, the strategies command

    tau = h + s M (v - qd) / T,        0 < s <= 1

with the largest s that keeps every torque within its limit. For v = 0 the added power is
`-s qd^T M qd / T <= 0`: braking takes energy out whatever the model's scale, and as all velocities
shrink in proportion the robot stops on its own path.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchline.contact.contact import Contact
from touchline.contact.state import State

Array = NDArray[np.float64]
Reaction = Callable[[Contact, State], Array]

SERVO_TIME = 5e-3  # s in which a velocity is taken on, torque limits permitting
HOLD_FREQUENCY = 30.0  # rad/s of the critically damped spring that holds a stopped robot
FLOAT_TIME = 0.5  # s in which a floating robot loses its velocity to friction
RETRACT_EASE = 0.05  # s over which the retraction slows down at its end
LEAST_LEVER = 1e-3  # m: below it no joint moves the point along the force


def ignore(contact: Contact, state: State) -> Array:
    """The robot's own controller goes on."""
    return state.torque


def stop(contact: Contact, state: State) -> Array:
    """Brakes along the path as hard as the torque limits allow, then holds the pose."""
    push = -state.inertia @ state.qd / SERVO_TIME
    if state.since is not None and state.since.rest is not None:
        w = HOLD_FREQUENCY
        wanted = w**2 * (state.since.rest - state.q) - 2 * w * state.qd
        push = state.inertia @ wanted
    return state.bias_torque + within_effort(state, push)


def float_(contact: Contact, state: State) -> Array:
    """Carries the weight, without stiffness: whoever touches the robot can move it away."""
    return state.bias_torque + within_effort(state, -state.inertia @ state.qd / FLOAT_TIME)


@dataclass(frozen=True)
class Retract:
    """Moves the touched point along the force, then stops.

    Of all joint motions that move the point so, it is the one of least kinetic energy. Where the
    point is not known the joints yield to the torques they feel; where no joint can move it, stop.

    Attributes:
        way: that the point moves away [m].
        speed: [m/s].
    """

    way: float = 0.05
    speed: float = 0.25

    def __call__(self, contact: Contact, state: State) -> Array:
        """Joint torques (n,) [Nm or N]."""
        lever = escape_lever(contact, state)
        if lever is None:
            return stop(contact, state)
        direction = np.linalg.solve(state.inertia, lever)
        direction = direction / (lever @ direction)
        left = self.way - state.advance(lever)
        goal = direction * np.clip(left / RETRACT_EASE, 0.0, self.speed)
        goal = goal / max(1.0, float(np.max(np.abs(goal) / state.speed_limit)))
        push = state.inertia @ (goal - state.qd) / SERVO_TIME
        return state.bias_torque + within_effort(state, push)


def escape_lever(contact: Contact, state: State) -> Array | None:
    """How fast each joint (n,) moves the touched point along the force; None: none can, or unknown.

    Without a place, the direction of the external joint torques, which are J^T f themselves,
    stands in, per newton of the segment's force (1 N where that is not known).
    """
    if contact.link is not None and contact.position is not None and contact.force is not None:
        size = float(np.linalg.norm(contact.force))
        if size == 0.0:
            return None
        lever = state.lever(contact.link, contact.position, contact.force / size)
    elif state.tau_ext is not None:
        size = 1.0 if contact.wrench is None else float(np.linalg.norm(contact.wrench[:3]))
        lever = np.nan_to_num(state.tau_ext) / max(size, 1.0)
    else:
        return None
    return lever if np.linalg.norm(lever) > LEAST_LEVER else None


def within_effort(state: State, push: Array) -> Array:
    """`push` (n,) made smaller as a whole until it fits, beside `bias_torque`, into the limits."""
    room = np.where(push > 0, state.effort - state.bias_torque, state.effort + state.bias_torque)
    size = np.abs(push)
    shares = np.divide(np.maximum(room, 0.0), size, out=np.ones_like(size), where=size > 0)
    return push * min(1.0, float(np.min(shares)))


REACTIONS: Mapping[str, Reaction] = {
    "ignore": ignore,
    "stop": stop,
    "float": float_,
    "retract": Retract(),
}
