# SPDX-License-Identifier: Apache-2.0
"""Chooses a reaction, keeps to it, and sees that no limit of the joints is broken."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from touchline.contact.contact import Contact
from touchline.contact.policy import Choice, Policy
from touchline.contact.reaction import REACTIONS, SERVO_TIME, Reaction, Retract, settled
from touchline.contact.state import Since, State
from touchline.errors import InputError
from touchline.model.description import PolicyDescription
from touchline.model.robot import Robot
from touchline.suggest import unknown

Array = NDArray[np.float64]

OWN = "own:"  # begins the name of a user's own reaction in `policy`

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


@dataclass(frozen=True)
class Command:
    """What the joints are to do.

    Attributes:
        torque: (n,) link side, within the limits [Nm or N].
        reaction: its name; "ignore": the robot's own controller goes on.
        contact: that it answers; None for none.
        reason: why: the rule or the limit.
        clipped: what had to be cut, as "torque JOINT" or "position JOINT".
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
        torque, clipped = limited(reaction(active.contact, state), state)
        choice = active.choice
        return Command(torque, choice.reaction, active.contact, choice.reason, clipped)


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
