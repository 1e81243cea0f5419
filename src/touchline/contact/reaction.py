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
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from touchline.contact.contact import Contact
from touchline.contact.state import Since, State

Array = NDArray[np.float64]
Reaction = Callable[[Contact, State], Array]

SERVO_TIME = 5e-3  # s in which a velocity is taken on, torque limits permitting
HOLD_FREQUENCY = 30.0  # rad/s of the critically damped spring that holds a stopped robot
FLOAT_TIME = 0.5  # s in which a floating robot loses its velocity to friction
RETRACT_SPEED = 0.25  # m/s of the touched point
RETRACT_WAY = 0.05  # m that it moves away
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


def retract(contact: Contact, state: State) -> Array:
    """Moves the touched point along the force by some centimetres, then stops.

    Of all joint motions that move the point so, it is the one of least kinetic energy. Where the
    point is not known the joints yield to the torques they feel; where no joint can move it, stop.
    """
    lever = escape_lever(contact, state)
    if lever is None:
        return stop(contact, state)
    direction = np.linalg.solve(state.inertia, lever)
    direction /= lever @ direction
    left = RETRACT_WAY - state.advance(lever)
    speed = np.clip(left / RETRACT_EASE, 0.0, RETRACT_SPEED)
    goal = direction * speed
    goal /= max(1.0, float(np.max(np.abs(goal) / state.speed_limit)))
    return state.bias_torque + within_effort(state, state.inertia @ (goal - state.qd) / SERVO_TIME)


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
    "retract": retract,
}


@dataclass(frozen=True)
class Command:
    """What the joints are to do.

    Attributes:
        torque: (n,) link side, within the limits [Nm or N].
        reaction: name of the strategy.
        contact: that it answers; None for none.
        clipped: what had to be cut, as "torque JOINT" or "position JOINT".
    """

    torque: Array
    reaction: str = "ignore"
    contact: Contact | None = None
    clipped: tuple[str, ...] = ()


REST = 0.02  # rad/s: slower than that the robot stands
LIMIT_TIME = 0.1  # s: how soon at the least a limit of position may be reached


def limited(torque: Array, state: State, positions: bool = True) -> tuple[Array, tuple[str, ...]]:
    """A torque (n,) that breaks no limit, and what had to be cut.

    A joint that would come nearer to a limit of its range than its velocity permits is braked;
    then all torques are cut to their limits.

    Args:
        torque: (n,) [Nm or N].
        state: of the robot.
        positions: whether limits of the range count too.
    """
    names, told = state.robot.joint_names, []
    if positions:
        lower, upper = state.range
        fastest, slowest = (upper - state.q) / LIMIT_TIME, (lower - state.q) / LIMIT_TIME
        near = (state.qd > fastest) | (state.qd < slowest)
        if near.any():
            wanted = np.clip(state.qd, np.minimum(slowest, fastest), np.maximum(slowest, fastest))
            brake = np.diag(state.inertia) * (wanted - state.qd) / SERVO_TIME
            held = state.bias_torque + brake
            outward = np.where(state.qd > fastest, torque > held, torque < held) & near
            torque = np.where(outward, held, torque)
            told += [f"position {names[j]}" for j in np.flatnonzero(outward)]
    cut = np.clip(torque, -state.effort, state.effort)
    told += [f"torque {names[j]}" for j in np.flatnonzero(np.abs(cut - torque) > 1e-9)]
    return cut, tuple(told)


class Reactor:
    """Chooses a reaction and keeps to it until it is reset.

    Args:
        choose: the name of the reaction to a contact.
        reactions: a user's own, by name, beside those of `REACTIONS`.
    """

    def __init__(
        self,
        choose: Callable[[Contact], str],
        reactions: Mapping[str, Reaction] | None = None,
    ) -> None:
        self._choose = choose
        self._reactions = {**REACTIONS, **(reactions or {})}
        self.reset()

    def reset(self) -> None:
        """Back to the robot's own controller."""
        self.active: str | None = None
        self._contact: Contact | None = None
        self._since: Since | None = None

    def update(self, contacts: list[Contact], state: State) -> Command:
        """The command for one instant.

        Args:
            contacts: of `Pipeline.update`.
            state: with the torque of the robot's own controller.
        """
        for contact in contacts:
            name = self._choose(contact)
            if self.active is None and name != "ignore":
                self.active, self._contact = name, contact
                self._since = Since(state.time, state.q.copy())
            elif self._contact is not None and contact.event == self._contact.event:
                self._contact = _clearer(self._contact, contact)
        if self.active is None or self._contact is None or self._since is None:
            torque, clipped = limited(state.torque, state, positions=False)
            return Command(torque, clipped=clipped)
        if self._since.rest is None and np.max(np.abs(state.qd)) < REST:
            self._since = replace(self._since, rest=state.q.copy())
        state = replace(state, since=self._since)
        torque, clipped = limited(self._reactions[self.active](self._contact, state), state)
        return Command(torque, self.active, self._contact, clipped)


def _clearer(known: Contact, now: Contact) -> Contact:
    """Of two views of one contact the one with the place, or else with more force."""
    if (known.position is None) != (now.position is None):
        return known if now.position is None else now
    return now if _size(now) > _size(known) else known


def _size(contact: Contact) -> float:
    force = contact.force if contact.force is not None else np.zeros(3)
    return float(force @ force)
