# SPDX-License-Identifier: Apache-2.0
"""A controller of your own that asks Touchline how to react: here in simulation, at 1 kHz."""

import numpy as np

import touchline as tl
from touchline.model.description import PolicyDescription, PolicyRule
from touchline.reaction.reaction import stop
from touchline.reaction.reactor import Reactor
from touchline.reaction.state import State
from touchline.simulation.encounter import EncounterScene


def gentle(contact, state: State) -> np.ndarray:
    """A reaction of one's own: joint torques (n,) from a contact and a state."""
    if contact.size > 30.0:
        return stop(contact, state)
    return state.bias_torque - 5.0 * state.qd


def main() -> None:
    robot = tl.load_robot("sara")
    scene = EncounterScene(robot, links=("link5", "link6"))
    encounter = scene.draw(("link5",), speed=0.5, rng=np.random.default_rng(4), mass=np.inf)
    for reaction in ("ignore", "stop", "retract", "own:gentle"):
        policy = PolicyDescription(rules=[PolicyRule(reaction, level="collision")])
        # In your own loop, with the torque that your controller asks for:
        #   result = pipeline.update(time, q, qd, tau, wrench)
        #   command = reactor.update(result.contacts, State(robot, time, q, qd, torque, tau_ext))
        #   send(command.torque)
        reactor = Reactor(robot, policy, {"gentle": gentle})
        outcome = scene.play(encounter, reactor, seconds=0.5)
        force = np.linalg.norm(outcome.force, axis=1)
        touch = outcome.readings.time[np.argmax(force > 0)]
        acted = [s.time - touch for s in outcome.steps if s.command.reaction != "ignore"]
        told = f"acts {1e3 * acted[0]:.0f} ms after the touch" if acted else "never acts"
        print(f"{reaction:10}  peak {force.max():4.0f} N, at the end {force[-1]:4.0f} N, {told}")


if __name__ == "__main__":
    main()
