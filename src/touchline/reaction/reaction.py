# SPDX-License-Identifier: Apache-2.0
"""What a robot can do about a contact: functions from a contact and a state to joint torques.

All torques are link-side torques (n,) [Nm or N]. With the inertia M, the torques `h` that keep the
velocity (weight, Coriolis, centrifugal) and a wanted joint velocity v, the strategies command

    tau = h + s M (v - qd) / T,        0 < s <= 1

with the largest s that keeps every torque within its limit. For v = 0 the added power is
`-s qd^T M qd / T <= 0`: braking takes energy out whatever the model's scale, and as all velocities
shrink in proportion the robot stops on its own path. Sparing a motion d of least kinetic energy,
`d = M^-1 l / (l^T M^-1 l)`, keeps that sign, by Cauchy and Schwarz.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.reaction.state import State
from touchline.result.contact import Contact

Reaction = Callable[[Contact, State], Array]

SERVO_TIME = 5e-3  # s in which a velocity is taken on, torque limits permitting
HOLD_FREQUENCY = 30.0  # rad/s of the critically damped spring that holds a stopped robot
CALM_TIME = 0.05  # s over which what is no collision is answered: a jerk looks like a blow
SIDE_TIME = 0.05  # s in which a stopping robot that is pushed away loses its other motion
NEW_TIME = 0.03  # s for which a contact presses whatever the external joint torques say
YIELD_TIME = 0.1  # s after which a stopping robot does not let itself be pushed away any more
STRONG, YIELD_MOST = 100.0, 3.0  # N from which it does so for longer, and how many times at most
YIELD_EASE = 0.03  # s before that over which it takes on the brake, without a jerk either
HOLD_TIME = 0.2  # s after which it holds its pose even if it is pushed on: brakes alone creep
REST = 0.02  # rad/s: slower than that the robot stands
FLOAT_TIME = 0.5  # s in which a floating robot loses its velocity to friction
RETRACT_EASE = 0.05  # s over which the retraction slows down at its end
PRESSING = 5.0  # N: with less a contact does not press any more
LEAST_LEVER = 0.02  # m: below it no joint moves the point along the force to speak of
REST_SHARE = 0.5  # of a segment's force: with more besides, a contact does not stand for it
STRAIGHT = 0.5  # cosine between force and motion below which the point would rather slide


def ignore(contact: Contact, state: State) -> Array:
    """The robot's own controller goes on."""
    return state.torque


def stop(contact: Contact, state: State) -> Array:
    """Brakes along the path as hard as the torque limits allow, then holds the pose.

    At first, as long as the contact presses, what moves the robot away from it is not braked: else
    a robot that stops would be harder to push away than one that does not react. While the touched
    point leaves, other motion is braked gently, as an error of the place mixes the two.
    """
    rest = None if state.since is None else state.since.rest
    if rest is not None:
        w = HOLD_FREQUENCY
        push = state.inertia @ (w**2 * (rest - state.q) - 2 * w * state.qd)
        return state.bias_torque + within_effort(state, push)
    escape = yielding(contact, state)
    if escape is not None and (leaving := float(escape[0] @ state.qd)) > 0.0:
        spared = min((_yield_time(escape[1], state) - state.age) / YIELD_EASE, 1.0)
        brake_time = SERVO_TIME + spared * (SIDE_TIME - SERVO_TIME)
        push = -state.inertia @ (state.qd - spared * leaving * escape[1]) / brake_time
    else:
        push = -state.inertia @ state.qd / SERVO_TIME
    return state.bias_torque + within_effort(state, urgency(contact, state) * push)


def urgency(contact: Contact, state: State) -> float:
    """Share, up to 1, of what the joints could do: at once, but for what is known to be no blow."""
    if contact.level == "collision" or not contact.decided:
        return 1.0
    return min(state.age / CALM_TIME, 1.0)


def pressing(direction: Array, state: State) -> float:
    """Force [N] that presses along a joint motion (n,) per metre, by the external joint torques."""
    if state.tau_ext is None:
        return 0.0
    return float(direction @ np.nan_to_num(state.tau_ext))


def yielding(contact: Contact, state: State) -> tuple[Array, Array] | None:
    """The `escape_motion` that `stop` leaves free; None once nothing presses, or it took too long.

    A new contact is taken to press: the external joint torques come through a filter, later.
    """
    if state.age > YIELD_MOST * YIELD_TIME:
        return None
    escape = escape_motion(contact, state)
    if escape is None or state.age < NEW_TIME:
        return escape
    presses = pressing(escape[1], state) > PRESSING and state.age < _yield_time(escape[1], state)
    return escape if presses else None


def _yield_time(direction: Array, state: State) -> float:
    """For how long `stop` yields: a soft and heavy body presses on for longer than a hard one."""
    return YIELD_TIME * min(max(pressing(direction, state) / STRONG, 1.0), YIELD_MOST)


def settled(contact: Contact, state: State) -> bool:
    """Whether `stop` may hold the pose: braked, or pushed on though it brakes."""
    if state.since is None or yielding(contact, state) is not None:
        return False
    return state.age > HOLD_TIME or bool(np.max(np.abs(state.qd)) < REST)


def float_(contact: Contact, state: State) -> Array:
    """Carries the weight, without stiffness: whoever touches the robot can move it away."""
    return state.bias_torque + within_effort(state, -state.inertia @ state.qd / FLOAT_TIME)


@dataclass(frozen=True)
class Retract:
    """Moves the touched point along the force, then stops.

    Of all joint motions that move the point so, it is the one of least kinetic energy. Where the
    point is not known the best candidate stands in, or else the joints yield to the torques they
    feel; where no joint can move the point away, the robot stops.

    Attributes:
        way: that the point moves away [m].
        speed: [m/s].
    """

    way: float = 0.05
    speed: float = 0.25

    def __call__(self, contact: Contact, state: State) -> Array:
        """Joint torques (n,) [Nm or N]."""
        escape = escape_motion(contact, state, STRAIGHT)
        if escape is None:
            return stop(contact, state)
        lever, direction = escape
        left, leaving = self.way - state.advance(lever), float(lever @ state.qd)
        speed = min(
            self.speed, float(np.min(state.speed_limit / np.maximum(np.abs(direction), 1e-9)))
        )
        speed, brake_time = min(max(left / RETRACT_EASE, 0.0), speed), SERVO_TIME
        if yielding(contact, state) is not None:  # pushed away faster than it would go by itself
            speed, brake_time = max(speed, leaving), SIDE_TIME
        rest = state.qd - leaving * direction
        push = state.inertia @ ((speed - leaving) * direction / SERVO_TIME - rest / brake_time)
        return state.bias_torque + within_effort(state, urgency(contact, state) * push)


def escape_motion(
    contact: Contact, state: State, straight: float = 0.0
) -> tuple[Array, Array] | None:
    """The joint motion of least kinetic energy that moves the touched point along the force.

    Args:
        contact: that presses.
        state: of the robot.
        straight: least cosine between the force and the way of the point, if it is known.

    Returns:
        How far each joint (n,) moves the point along the force, and the joint motion (n,) that
        moves it by one metre; None where no joint can, where the point would rather slide along
        the surface, or where nothing is known.
    """
    place = _place(contact, guess=state.tau_ext is None)
    if place is None:
        return _yielding(contact, state)
    link, point, force = place
    jacobian = np.array([state.lever(link, point, axis) for axis in np.eye(3)])
    lever = force @ jacobian / np.linalg.norm(force)
    if np.linalg.norm(lever) < LEAST_LEVER:
        return None
    direction = _least_energy(state, lever)
    cosine = 1.0 / float(np.linalg.norm(jacobian @ direction))
    return (lever, direction) if cosine > straight else None


def _place(contact: Contact, guess: bool) -> tuple[str, Array, Array] | None:
    """Link, point and force of what presses; with `guess` those of the best candidate too.

    None as well where the force is not most of what the segment feels: a blow beside a contact that
    was there before is felt some time before its own place is known.
    """
    whole = known_force(contact)
    force = whole if contact.force is None else contact.force
    if force is None or not np.any(force):
        return None
    most = whole is None or np.linalg.norm(whole - force) < REST_SHARE * np.linalg.norm(whole)
    if most and contact.link is not None and contact.position is not None:
        return contact.link, contact.position, force
    best = next(iter(contact.candidates), None) if guess else None
    return None if best is None else (best.link, best.position, force)


def known_force(contact: Contact) -> Array | None:
    """The force (3,) on the contact's segment [N]; None where a sensor that it needs is silent."""
    if contact.wrench is None or not np.isfinite(contact.wrench[:3]).all():
        return None
    return contact.wrench[:3]


def brake(state: State) -> Array:
    """Torques (n,) that take the velocity out as fast as the limits allow; needs no contact."""
    return state.bias_torque + within_effort(state, -state.inertia @ state.qd / SERVO_TIME)


def _yielding(contact: Contact, state: State) -> tuple[Array, Array] | None:
    """Without a place: along the external joint torques, which are J^T f themselves."""
    if state.tau_ext is None:
        return None
    whole = known_force(contact)
    force = contact.force if whole is None else whole
    size = 0.0 if force is None else float(np.linalg.norm(force))
    lever = np.nan_to_num(state.tau_ext) / max(size, 1.0)
    if np.linalg.norm(lever) < LEAST_LEVER:
        return None
    return lever, _least_energy(state, lever)


def _least_energy(state: State, lever: Array) -> Array:
    motion = np.linalg.solve(state.inertia, lever)
    return motion / (lever @ motion)


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
