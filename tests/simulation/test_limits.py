# SPDX-License-Identifier: Apache-2.0
"""No reaction breaks a limit of the joints, whatever it asks for."""

import numpy as np
import pytest

from touchline.model.description import PolicyDescription, PolicyRule
from touchline.reaction.reactor import Reactor
from touchline.reaction.state import State
from touchline.result.contact import Contact
from touchline.simulation.plant import Plant

CONTROL = 2  # physics steps of 0.5 ms


def near_a_limit(robot, rng):
    """A pose (n,) with one joint near an end of its range, a velocity, and the side."""
    still = np.zeros(len(robot.joint_names))
    lower, upper = State(robot, 0.0, still, still, still).range
    q, side = rng.uniform(lower, upper), rng.choice([-1.0, 1.0])
    joint, way = rng.integers(len(q)), rng.uniform(0.0, 0.1)
    q[joint] = upper[joint] - way if side > 0 else lower[joint] + way
    qd = np.clip(rng.uniform(-0.5, 0.5, len(q)), (lower - q) / 0.1, (upper - q) / 0.1)
    return q, qd, side


@pytest.mark.parametrize("reaction", ["retract", "float", "own:push"])
def test_a_reaction_that_would_break_limits_is_cut_and_that_is_told(sara, reaction):
    plant, told = Plant(sara, 2000.0), set()
    for seed in range(5):
        rng = np.random.default_rng([7, seed])
        q, qd, side = near_a_limit(sara, rng)

        def push(contact, state, side=side):
            return np.full(7, 200.0 * side)

        policy = PolicyDescription(rules=[PolicyRule(reaction)])
        reactor = Reactor(sara, policy, {"push": push})
        position = sara.T_world_links(q)["link6"][:3, 3]
        force = rng.normal(size=3) * 100.0
        contact = Contact(
            "base", 0, "collision", "located", link="link6", position=position, force=force,
            decided=True,
        )  # fmt: skip
        plant.reset(q, qd)
        for step in range(600):
            plant.evaluate()
            if step % CONTROL == 0:
                state = State(sara, plant.time, plant.q, plant.qd, np.zeros(7), np.zeros(7))
                command = reactor.update([contact], state)
                told |= {cut.split()[0] for cut in command.clipped}
                assert np.all(np.abs(command.torque) <= state.effort)
            plant.command(command.torque)
            plant.accelerate()
            plant.integrate()
            lower, upper = state.range
            assert np.max(np.maximum(plant.q - upper, lower - plant.q)) < 0.01
    assert "position" in told
    assert reaction != "own:push" or {"torque", "speed"} <= told
