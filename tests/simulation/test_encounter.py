# SPDX-License-Identifier: Apache-2.0
"""The closed loop: collisions, clamping and guiding with a reactor, short and with fixed seeds."""

import numpy as np
import pytest

from touchline.bench.guiding import guide, handle_point
from touchline.bench.reaction_trial import Case, measure, reactor
from touchline.simulation.encounter import EncounterScene
from touchline.simulation.noise import SensorNoise
from touchline.simulation.obstacle import Body
from touchline.simulation.scene import Run

SECONDS = 0.5


@pytest.fixture(scope="module")
def scene(sara):
    settings = Run(noise=SensorNoise(), control=1000.0, model_error=0.02)
    return EncounterScene(sara, settings, links=("link3", "link5"))


def played(scene, case, encounter, name, hand=None):
    outcome = scene.play(encounter, reactor(scene.robot, name), SECONDS, case.seed, hand)
    return outcome, measure(outcome, case, name, scene.robot)


def test_reactions_relieve_a_clamping(scene):
    case = Case("wall", "link5", 0.5, 0)
    rng = np.random.default_rng(4)
    encounter = scene.draw(("link5",), case.speed, rng, mass=np.inf)
    trials = {n: played(scene, case, encounter, n)[1] for n in ("ignore", "stop", "retract")}
    assert np.isnan(trials["ignore"].reacted)
    for name in ("stop", "retract"):
        assert trials[name].reacted < 0.02 and not trials[name].false
        assert trials[name].peak <= trials["ignore"].peak * 1.001
        assert trials[name].effort <= 1.0 + 1e-9
    assert trials["retract"].quiet < 0.3
    assert trials["retract"].impulse < 0.5 * trials["ignore"].impulse


def test_a_led_arm_reacts_to_the_blow_and_not_to_the_hand(scene):
    case = Case("guided", "link3", 1.0, 1)
    encounter = scene.draw(("link3",), case.speed, np.random.default_rng(1), own_share=0.0)
    hand = ("handle", handle_point(scene.plant))
    outcome, trial = played(scene, case, encounter, "stop", hand)
    assert 0.0 <= trial.reacted < 0.02 and not trial.false
    grip = np.linalg.norm(outcome.truth.force[:, 1], axis=1)
    assert grip.max() > 1.0
    step = next(s for s in outcome.steps if s.command.reaction == "stop")
    assert step.command.contact.segment == "base" and step.command.reason == "rule 1"


def test_a_minute_of_guiding_is_no_collision():
    part = guide(0, seconds=15.0)
    assert part.collisions == 0 and part.felt > 0.95 and part.force > 10.0


def test_the_obstacle_is_a_mass_on_a_spring(scene):
    """Without a robot in the way it flies on; its surface is where it is said to be."""
    plant, obstacle = scene.plant, scene.obstacle
    plant.reset(scene.setup.home)
    body = Body([3.0, 0.0, 1.0], [0.0, 1.0, 0.0], time=0.1, speed=0.8, mass=2.0)
    obstacle.place(plant, body)
    for _ in range(400):
        plant.evaluate()
        plant.command(plant.gravity_torque())
        obstacle.apply(plant)
        plant.accelerate()
        plant.integrate()
    assert plant.time == pytest.approx(0.1)
    plant.evaluate()
    pad = plant.data.body("obstacle:pad").xpos + 0.03 * np.array([0.0, 1.0, 0.0])
    assert pad == pytest.approx([3.0, 0.0, 1.0], abs=1e-6)
    assert not obstacle.touches(plant)[0].active
