# SPDX-License-Identifier: Apache-2.0
"""The MuJoCo plant has exactly the robot's masses, and MuJoCo's physics are sound."""

from dataclasses import replace

import numpy as np
import pytest
from robots import describe, random_mechanism, random_pose, random_robot

import touchline as tl
from touchline.errors import InputError
from touchline.model.description import JointDescription
from touchline.model.mechanism import Inertia, Mimic
from touchline.model.robot import Robot
from touchline.simulation.contacts import Profile, ScriptedContact, ScriptedForces
from touchline.simulation.control import GravityCompensation, JointImpedance, hold
from touchline.simulation.plant import Plant
from touchline.simulation.setup import read_setup
from touchline.simulation.simulator import Rates, Simulation, run


def state(robot, seed=1):
    rng = np.random.default_rng(seed)
    n = len(robot.joint_names)
    return rng.uniform(-1, 1, n), rng.uniform(-2, 2, n)


def at_state(plant, q, qd):
    plant.reset(q, qd)
    plant.evaluate()
    return plant


def robot_with_odd_joints():
    """A branched robot with a locked joint, a mimicking pair, a massless link and a sensor twice
    on one link."""
    mechanism = random_mechanism(np.random.default_rng(5))
    joints, links = dict(mechanism.joints), dict(mechanism.links)
    joints["joint5"] = replace(joints["joint5"], mimic=Mimic("joint2", -0.5, 0.2))
    links["plate2"] = replace(links["plate2"], inertia=Inertia.zero())
    mechanism = replace(mechanism, joints=joints, links=links)
    rows = tuple(JointDescription(f"joint{i}") for i in (1, 2, 4, 6, 7))
    pose = random_pose(np.random.default_rng(0))[:3, 3]
    sensors = [("a", "link0"), ("b", "link4"), ("c", "link4", tuple(pose), (0.1, 0.2, 0.3))]
    return Robot(describe(mechanism, sensors, joints=rows, locked={"joint3": 0.4}), mechanism)


ROBOTS = {"chain": lambda: random_robot(3, chain=True), "tree": lambda: random_robot(4)}


@pytest.mark.parametrize("make", [*ROBOTS.values(), robot_with_odd_joints])
def test_momenta_of_the_plant_are_those_of_the_model(make):
    robot = make()
    q, qd = state(robot)
    plant = at_state(Plant(robot), q, qd)
    momenta, _ = robot.terms(q, qd)
    np.testing.assert_allclose(plant.inertia_times(qd), momenta[: len(q)], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("make", [*ROBOTS.values(), robot_with_odd_joints])
def test_links_are_where_the_model_has_them(make):
    robot = make()
    q, qd = state(robot)
    plant = at_state(Plant(robot), q, qd)
    for link, T in robot.T_world_links(q).items():
        np.testing.assert_allclose(plant.link_pose(link), T, atol=1e-9)


def test_mass_is_exact_also_where_a_real_body_could_not_have_the_inertia():
    mechanism = random_mechanism(np.random.default_rng(1))
    odd = replace(mechanism.links["link3"], inertia=Inertia(1.234, np.ones(3), np.diag([1, 0, 5])))
    mechanism = replace(mechanism, links={**mechanism.links, "link3": odd})
    robot = Robot(describe(mechanism, [("base", "link0")]), mechanism)
    q, qd = state(robot)
    plant = at_state(Plant(robot), q, qd)
    total = sum(link.inertia.mass for link in mechanism.links.values())
    assert plant.model.body_mass.sum() == pytest.approx(total, abs=1e-12)
    momenta, _ = robot.terms(q, qd)
    np.testing.assert_allclose(plant.inertia_times(qd), momenta[:7], rtol=1e-9)


def test_a_joint_that_carries_no_mass_is_refused():
    mechanism = random_mechanism(np.random.default_rng(1), chain=True)
    bare = {n: replace(mechanism.links[n], inertia=Inertia.zero()) for n in ("link7", "plate6")}
    mechanism = replace(mechanism, links={**mechanism.links, **bare})
    robot = Robot(describe(mechanism, [("base", "link0")]), mechanism)
    with pytest.raises(InputError, match="joint7.*no mass"):
        Plant(robot)


def test_resting_sensors_read_the_weight_they_carry(sara):
    setup = read_setup(sara)
    plant = Plant(sara)
    plant.reset(setup.home)
    still = JointImpedance(hold(setup.home), setup.stiffness, setup.damping)
    readings, _ = run(plant, still, seconds=0.02)
    links = sara.mechanism.links
    carried = {
        "base": [name for name in links if name != "base_mount"],
        "wrist": ["tool"],
        "handle": ["handle"],
    }
    for s, name in enumerate(sara.sensor_names):
        weight = 9.81 * sum(links[link].inertia.mass for link in carried[name])
        assert np.linalg.norm(readings.wrench[-1, s, :3]) == pytest.approx(weight, abs=1e-6)
    assert readings.wrench[-1, 0, 2] > 0  # the ground holds the arm up
    np.testing.assert_allclose(readings.link_torque[-1], plant.gravity_torque(), atol=1e-9)


def test_energy_grows_by_the_work_of_contacts_and_motors(sara):
    """No damping: kinetic and potential energy change by what goes in, and by nothing else."""
    setup = read_setup(sara)
    plant = Plant(sara, rate=4000)
    plant.reset(setup.home, np.full(7, 0.3))
    push = ScriptedContact("tool", [0, 0, 0.1], [5, 20, 5], Profile(0.05, rise=0.1))
    energies = []

    class Meter(GravityCompensation):
        def torque(self, plant):
            import mujoco

            mujoco.mj_energyPos(plant.model, plant.data)
            mujoco.mj_energyVel(plant.model, plant.data)
            energies.append(plant.data.energy.sum())
            return super().torque(plant)

    readings, truth = run(plant, Meter(), [ScriptedForces([push])], 0.3, Rates(4000))
    energy = np.array(energies)[1:]  # one per sample of the log
    power = np.einsum("nj,nj->n", readings.link_torque, readings.qd)
    velocity = np.gradient(truth.point[:, 0], readings.time, axis=0)
    power = power + np.nan_to_num(np.einsum("ni,ni->n", truth.force[:, 0], velocity))
    work = np.concatenate([[0], np.cumsum((power[1:] + power[:-1]) / 2 / 4000)])
    assert np.ptp(work) > 1.0
    np.testing.assert_allclose(energy - energy[0], work, atol=2e-3)


def test_rates_must_divide_the_physics(sara):
    with pytest.raises(ValueError, match="log rate 3000"):
        run(Plant(sara), GravityCompensation(), rates=Rates(3000))


def test_a_simulation_in_parts_is_the_same_as_in_one():
    robot = tl.load_robot("sara")
    setup = read_setup(robot)

    def simulation():
        plant = Plant(robot, 2000.0)
        plant.reset(setup.home, time=-1e-3)
        controller = JointImpedance(hold(setup.home), setup.stiffness, setup.damping)
        push = ScriptedContact("link4", (0, 0, 0.1), (15.0, 0, -5.0), Profile(0.02, 0.04))
        return Simulation(plant, controller, [ScriptedForces([push])], Rates(1000.0, 500.0))

    whole = simulation().advance(150)
    other = simulation()
    parts = [other.advance(rows) for rows in (1, 40, 59, 50)]
    for of, names in ((0, ("time", "q", "qd", "link_torque", "wrench")), (1, ("link", "force"))):
        for name in (*names, *(("wrench_mean",) if of else ())):
            joined = np.concatenate([getattr(part[of], name) for part in parts])
            assert np.array_equal(joined, getattr(whole[of], name), equal_nan=True), name
