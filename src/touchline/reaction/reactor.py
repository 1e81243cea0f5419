# SPDX-License-Identifier: Apache-2.0
"""Chooses a reaction, keeps to it, and sees that no limit of the joints is broken."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array, Mask
from touchline.errors import InputError
from touchline.model.description import PolicyDescription
from touchline.model.robot import Robot
from touchline.reaction.policy import Choice, Policy
from touchline.reaction.reaction import (
    REACTIONS,
    SERVO_TIME,
    Reaction,
    Retract,
    brake,
    settled,
    within_effort,
)
from touchline.reaction.state import Since, State
from touchline.result.contact import Contact
from touchline.suggest import unknown

OWN = "own:"  # begins the name of a user's own reaction in `policy`

LIMIT_TIME = 0.1  # s: how soon at the least a limit of position may be reached
BRAKE_SHARE = 0.5  # of the deceleration that a joint's torque gives it, to count on


def limited(torque: Array, state: State, positions: bool = True) -> tuple[Array, tuple[str, ...]]:
    """A torque (n,) that breaks no limit, and what had to be cut.

    All torques are cut to their limits. A joint that would come nearer to a limit of its range
    than its velocity permits is braked, whatever the others do. None is driven beyond its limit of
    velocity, but what pushes it there is not held against. Where the torques of these joints are
    not enough for that, all joints are braked.

    Args:
        torque: (n,) [Nm or N].
        state: of the robot.
        positions: whether limits of range and velocity count too.
    """
    names = state.robot.joint_names
    cut = np.clip(torque, -state.effort, state.effort)
    told = [f"torque {names[j]}" for j in np.flatnonzero(np.abs(cut - torque) > 1e-9)]
    if positions:
        ends = _permitted(state)
        speeds = np.array([-state.speed_limit, state.speed_limit])
        by_range, by_speed = (ends - state.qd) / SERVO_TIME, (speeds - state.qd) / SERVO_TIME
        by_speed = np.array([np.minimum(by_speed[0], 0.0), np.maximum(by_speed[1], 0.0)])
        lowest = np.maximum(by_range[0], by_speed[0])
        highest = np.minimum(by_range[1], by_speed[1])
        cut, held = _accelerated(cut, state, np.minimum(lowest, highest), highest)
        near = (by_range[0] >= by_speed[0]) | (by_range[1] <= by_speed[1])
        told += [f"position {names[j]}" for j in np.flatnonzero(held & near)]
        told += [f"speed {names[j]}" for j in np.flatnonzero(held & ~near)]
    return cut, tuple(told)


def _permitted(state: State) -> Array:
    """Least and greatest velocities (2, n) from which the joints can stop within their range."""
    lower, upper = state.range
    room = np.maximum(state.effort - np.abs(state.bias_torque), 0.0)
    deceleration = BRAKE_SHARE * room / np.diag(state.inertia)

    def speed(way: Array) -> Array:
        inside = np.maximum(way, 0.0)
        able = np.minimum(inside / LIMIT_TIME, np.sqrt(2.0 * deceleration * inside))
        return np.where(way < 0.0, way / LIMIT_TIME, able)  # from beyond, back

    return np.array([-speed(state.q - lower), speed(upper - state.q)])


def _accelerated(torque: Array, state: State, lowest: Array, highest: Array) -> tuple[Array, Mask]:
    """Torques (n,) that keep the joints' accelerations (n,) within bounds; also says of which.

    Only joints that would leave them get other torques. What pushes the robot is not counted.
    """
    M, bias = state.inertia, state.bias_torque
    acceleration, out = np.linalg.solve(M, torque - bias), torque
    bound, held = np.zeros_like(torque), np.zeros(len(torque), dtype=bool)
    while True:
        inside = np.clip(acceleration, lowest, highest)
        worse = ~held & (np.abs(acceleration - inside) > 1e-9 * (1.0 + np.abs(inside)))
        if not worse.any():
            break
        bound[worse], held = inside[worse], held | worse
        free = ~held
        acceleration = bound.copy()
        rest = torque[free] - bias[free] - M[np.ix_(free, held)] @ bound[held]
        acceleration[free] = np.linalg.solve(M[np.ix_(free, free)], rest)
        out = np.where(held, bias + M @ acceleration, torque)
    if np.any(np.abs(out) > state.effort):
        brake = M @ np.clip(-state.qd / SERVO_TIME, lowest, highest)
        out = np.clip(bias + within_effort(state, brake), -state.effort, state.effort)
    return out, held


@dataclass(frozen=True)
class Command:
    """What the joints are to do.

    Attributes:
        torque: (n,) link side, within the limits [Nm or N].
        reaction: its name; "ignore": the robot's own controller goes on.
        contact: that it answers; None for none.
        reason: why: the rule or the limit.
        clipped: what had to be cut, as "torque JOINT", "position JOINT" or "speed JOINT".
    """

    torque: Array
    reaction: str = "ignore"
    contact: Contact | None = None
    reason: str = ""
    clipped: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Active:
    choice: Choice
    contact: Contact
    since: Since


class Reactor:
    """From contacts to joint torques, one instant at a time.

    What a collision or a broken force limit calls for stays until `reset`; what a contact calls
    for ends with it. The former goes before the latter, and then the earlier rule.

    Args:
        robot: whose description holds the policy.
        policy: instead of the description's.
        reactions: a user's own, by name; `policy` calls them `own:NAME`.

    Raises:
        InputError: the policy names a reaction of the user's own that is not there.
    """

    def __init__(
        self,
        robot: Robot,
        policy: PolicyDescription | None = None,
        reactions: Mapping[str, Reaction] | None = None,
    ) -> None:
        description = policy or robot.description.policy
        own = reactions or {}
        self.policy = Policy(description)
        self._reactions: dict[str, Reaction] = dict(REACTIONS)
        self._reactions["retract"] = Retract(**vars(description.retract))
        self._reactions.update({f"{OWN}{name}": reaction for name, reaction in own.items()})
        wanted = [rule.reaction for rule in description.rules]
        wanted += [limit.reaction for limit in description.limits.values()]
        missing = [name for name in wanted if name not in self._reactions]
        if missing:
            known = tuple(self._reactions)
            raise InputError([f"policy: {unknown(name, 'reaction', known)}" for name in missing])
        self.reset()

    def reset(self) -> None:
        """Back to the robot's own controller."""
        self._active: _Active | None = None
        self._begun: dict[int, float] = {}

    @property
    def active(self) -> str | None:
        """The reaction that is going on."""
        return None if self._active is None else self._active.choice.reaction

    def update(self, contacts: Sequence[Contact], state: State) -> Command:
        """The command for one instant.

        Args:
            contacts: of `Pipeline.update`.
            state: with the torque of the robot's own controller.
        """
        present = {contact.event for contact in contacts}
        self._begun = {e: self._begun.get(e, state.time) for e in present}
        active = self._active
        if active and not active.choice.lasting and active.contact.event not in present:
            active = None
        for contact in contacts:
            choice = self.policy.choose(contact, state.time - self._begun[contact.event])
            if active is None or _before(choice, active.choice):
                if choice.reaction != "ignore":
                    active = _taken_on(active, choice, contact, state)
            elif choice.rank == active.choice.rank or contact.event == active.contact.event:
                active = replace(active, contact=_clearer(active.contact, contact))
        self._active = active
        return self._ignore(state) if active is None else self._react(active, state)

    def _ignore(self, state: State) -> Command:
        torque, clipped = limited(state.torque, state, positions=False)
        return Command(torque, clipped=clipped)

    def _react(self, active: _Active, state: State) -> Command:
        since = active.since
        state = replace(state, since=since)
        if since.rest is None and settled(active.contact, state):
            since = replace(since, rest=state.q.copy())
            self._active = replace(active, since=since)
            state = replace(state, since=since)
        reaction = self._reactions[active.choice.reaction]
        choice, torque = active.choice, reaction(active.contact, state)
        reason = choice.reason
        if not np.isfinite(torque).all():
            torque, reason = brake(state), f"{choice.reaction} gave no finite torque: brakes"
        torque, clipped = limited(torque, state)
        return Command(torque, choice.reaction, active.contact, reason, clipped)


def _taken_on(active: _Active | None, choice: Choice, contact: Contact, state: State) -> _Active:
    """What a contact calls for, begun anew unless the same contact has called for it before."""
    if active and active.choice.reaction == choice.reaction:
        if active.contact.event == contact.event:
            return replace(active, choice=choice, contact=contact)
    return _Active(choice, contact, Since(state.time, state.q.copy()))


def _before(choice: Choice, other: Choice) -> bool:
    return (not choice.lasting, choice.rank) < (not other.lasting, other.rank)


def _clearer(known: Contact, now: Contact) -> Contact:
    """Of two contacts that call for the same, the stronger; one without a place counts half."""
    weights = [c.size * (1.0 if c.position is not None else 0.5) for c in (known, now)]
    return now if weights[1] > weights[0] else known
