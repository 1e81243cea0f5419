# SPDX-License-Identifier: Apache-2.0
"""The closed loop: collisions, clamping and guiding with a reactor, short and with fixed seeds."""

import numpy as np
import pytest

from touchline.model.description import PolicyDescription, PolicyRule
from touchline.pipeline.pipeline import Pipeline
from touchline.reaction.reactor import Reactor
from touchline.simulation.closed_loop import LiveSensors, ReactingController
from touchline.simulation.contacts import Profile, ScriptedContact, ScriptedForces
from touchline.simulation.encounter import EncounterScene
from touchline.simulation.noise import SensorNoise
from touchline.simulation.obstacle import TOUCHES, Body
from touchline.simulation.scene import Run, impedance, make_plant
from touchline.simulation.simulator import Rates, run
from touchline.trials.guiding import guide, handle_point
from touchline.trials.reacting import (
    Case,
    arm_scene,
    encounter_of,
    measure,
    outcome_of,
    pressing,
    reactor,
)

SECONDS = 0.5


@pytest.fixture(scope="module")
def scene(sara):
    settings = Run(noise=SensorNoise(), control=1000.0, model_error=0.02)
    return EncounterScene(sara, settings, links=("link3", "link5", "link7", "tool"))


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


def test_a_stretched_arm_does_not_tremble_before_it_is_struck():
    case = Case("free", "link5", 0.5, 0)
    outcome = outcome_of(case, encounter_of(case), "retract")
    before = np.flatnonzero(pressing(outcome))[0]
    tremble = np.abs(np.diff(outcome.readings.qd[:before], 2, axis=0))
    assert tremble.max() < 0.1  # rad/s; 18 with dampers that overshoot from sample to sample
    assert measure(outcome, case, "retract", arm_scene().robot).reacted < 0.02


def test_a_blow_of_one_sample_that_one_axis_feels_most_is_answered():
    """318 N for a millisecond on link 2: the base's y was taken for a spike, then for stuck."""
    case = Case("free", "link2", 1.0, 0)
    outcome = outcome_of(case, encounter_of(case), "retract")
    first = np.flatnonzero(pressing(outcome))[0]
    assert pressing(outcome)[first] > 5.0 * pressing(outcome)[first + 1]
    assert measure(outcome, case, "retract", arm_scene().robot).reacted < 0.02


@pytest.mark.parametrize(("link", "seed"), [("link3", 5), ("link5", 2)])
def test_a_stopped_arm_that_is_pushed_on_does_not_creep(scene, link, seed):
    """20 N that never end, on a moving arm; yielding at first is meant, creeping is not."""
    robot, settings, seconds = scene.robot, scene.settings, 1.2
    plant = make_plant(robot, settings)
    encounter = scene.draw((link,), 0.3, np.random.default_rng(seed))
    T = robot.T_world_links(encounter.q)[link]
    point = T[:3, :3].T @ (np.asarray(encounter.body.point) - T[:3, 3])
    force = 20.0 * np.asarray(encounter.body.direction)
    push = ScriptedContact(link, point, force, Profile(0.15, shape="step"))
    trajectory = encounter.trajectory()
    plant.reset(trajectory(0.0).q, trajectory(0.0).qd)
    rng = np.random.default_rng(seed)
    count = 1 + round(seconds * settings.rate)
    sensors = LiveSensors(plant, count, settings.rate, settings.noise, rng)
    pipeline = Pipeline(robot, period=1.0 / settings.rate, skin=scene.skin)
    own = impedance(scene.setup, trajectory)
    stopping = Reactor(robot, PolicyDescription(rules=[PolicyRule("stop")]))
    controller = ReactingController(robot, own, pipeline, stopping, sensors)
    rates, forces = Rates(settings.rate, settings.control), [ScriptedForces([push])]
    readings, _ = run(plant, controller, forces, seconds, rates, controller.sampled)
    assert controller.steps[-1].command.reaction == "stop"
    late = readings.time > 0.15 + 0.5
    assert np.ptp(readings.q[late], axis=0).max() < 2e-3
    assert np.abs(readings.qd[late]).max() < 0.01
    moved = readings.q[late] - readings.q[np.searchsorted(readings.time, 0.15)]
    assert np.abs(moved).max() < 0.2


def test_a_led_arm_reacts_to_the_blow_and_not_to_the_hand(scene):
    case = Case("guided", "link3", 1.0, 1)
    encounter = scene.draw(("link3",), case.speed, np.random.default_rng(1), own_share=0.0)
    hand = ("handle", handle_point(scene.plant))
    outcome, trial = played(scene, case, encounter, "stop", hand)
    assert 0.0 <= trial.reacted < 0.02 and not trial.false
    grip = np.linalg.norm(outcome.truth.force[:, -1], axis=1)
    assert grip.max() > 1.0
    step = next(s for s in outcome.steps if s.command.reaction == "stop")
    assert step.command.contact.segment == "base" and step.command.reason == "rule 1"


@pytest.mark.parametrize(("link", "index"), [("link5", 4), ("link7", 5)])
def test_a_stop_of_a_led_arm_does_not_raise_the_peak(scene, link, index):
    """The point gives way before the filtered torques show it, and the first place is rough."""
    rng = np.random.default_rng([0, 2, index, 500])
    encounter = scene.draw((link,), 0.5, rng, own_share=0.0)
    hand = ("handle", handle_point(scene.plant))
    peaks = {}
    for name in ("ignore", "stop"):
        outcome = scene.play(encounter, reactor(scene.robot, name), 0.3, 0, hand)
        peaks[name] = pressing(outcome).max()
    assert 50.0 < peaks["stop"] <= peaks["ignore"]


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
    assert not any(touch.active for touch in obstacle.touches(plant))


def test_a_body_between_two_links_presses_both(scene):
    """It touches link7 and the tool at once; forces of both compress its spring."""
    rng = np.random.default_rng([0, 0, 5, 1000])
    encounter = scene.draw(("link7",), 1.0, rng)
    outcome = scene.play(encounter, reactor(scene.robot, "ignore"), 0.2)
    first, second = (np.linalg.norm(outcome.truth.force[:, k], axis=1) for k in range(TOUCHES))
    row = int(np.argmax(second))
    links = [outcome.truth.links[k] for k in outcome.truth.link[row]]
    assert links == ["link7", "tool"] and first[row] > second[row] > 20.0
    inwards = np.asarray(encounter.body.direction)
    assert pressing(outcome)[row] > outcome.truth.force[row, 0] @ inwards + 15.0
    assert pressing(outcome).max() == pytest.approx(191.3, rel=0.03)  # 195.3 N in the spring
