# SPDX-License-Identifier: Apache-2.0
"""The arm's controller on the live page: its own impedance, until a reaction takes over."""

import numpy as np

from touchline.arrays import Array
from touchline.model.description import PolicyDescription, PolicyRule
from touchline.model.robot import Robot
from touchline.reaction.reactor import Reactor
from touchline.reaction.state import State
from touchline.result.contact import Contact
from touchline.simulation.control import JointImpedance
from touchline.simulation.plant import Plant
from touchline.view.motion import Switched

CALM = 1.0  # s without contact, after which what a collision called for ends


class ReactingImpedance:
    """Impedance control about a trajectory; contacts are answered by the reaction that is set.

    Args:
        robot: for the reactions' own dynamics.
        impedance: about `trajectory`.
        trajectory: to which the arm eases back after a reaction.

    Attributes:
        reaction: to every contact, of `contact.reaction.REACTIONS`.
        contacts: that are felt now.
        tau_ext: (n,) external joint torques that are felt now [Nm]; None: not yet.
    """

    def __init__(self, robot: Robot, impedance: JointImpedance, trajectory: Switched) -> None:
        self.impedance, self.reaction = impedance, "ignore"
        self.contacts: list[Contact] = []
        self.tau_ext: Array | None = None
        self._robot, self._trajectory = robot, trajectory
        self._reactor: Reactor | None = None
        self._reacts_by = "ignore"
        self._touched = -np.inf

    @property
    def active(self) -> str | None:
        """The reaction that has taken over."""
        return None if self._reactor is None else self._reactor.active

    def torque(self, plant: Plant) -> Array:
        """Motor torques (n,) [Nm] for the plant's present state."""
        before = self.active
        self._choose(plant.time)
        own = self.impedance.torque(plant)
        torque = own
        if self._reactor is not None:
            friction = plant.friction_torque()  # a state's torques are those behind the drives
            now = plant.time, plant.q, plant.qd, own - friction
            state = State(self._robot, *now, self.tau_ext)
            torque = self._reactor.update(self.contacts, state).torque + friction
        if before and not self.active:
            self._trajectory.resume(plant.q, plant.time)
            torque = self.impedance.torque(plant)
        return torque

    def _choose(self, time: float) -> None:
        """Takes on the reaction that is set, and ends one that lasts beyond its contact."""
        if self.contacts:
            self._touched = time
        if self.reaction != self._reacts_by:
            self._reacts_by = self.reaction
            policy = PolicyDescription(rules=[PolicyRule(self.reaction)])
            wanted = self.reaction != "ignore"
            self._reactor = Reactor(self._robot, policy) if wanted else None
        elif self._reactor is not None and time > self._touched + CALM:
            self._reactor.reset()
