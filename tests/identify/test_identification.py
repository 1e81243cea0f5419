# SPDX-License-Identifier: Apache-2.0
"""What is put into a robot is found again, and nothing that is not there."""

from dataclasses import replace

import numpy as np
import pytest
from free_motion import free_motion
from robots import random_robot

import touchline as tl
from touchline.identify.choice import Chooser
from touchline.identify.described import description_changes, identified_robot
from touchline.identify.evidence import gather
from touchline.identify.identification import identify
from touchline.identify.laws import SPEEDS, spread
from touchline.identify.payload import payload_mass
from touchline.identify.physical import PhysicalBody, pseudo_inertia
from touchline.identify.regressor import body_vector
from touchline.identify.summary import identification_lines
from touchline.model.corrections import load_inertia
from touchline.model.description import Friction, Load
from touchline.model.perturbed import perturbed
from touchline.model.robot import Robot
from touchline.model.transforms import combine_inertias

SECONDS, RATE = 30.0, 100.0


def arm(seed=0, sensors=0):
    """A chain of five joints, with a sensor at its base if wanted."""
    robot = random_robot(seed, sensors=max(sensors, 1), chain=True, bandwidth=20.0, movable=5)
    if sensors:
        return robot
    return Robot(replace(robot.description, sensors=()), robot.mechanism)


def recorded(robot, noise=0.01):
    """Samples of a robot as it moves; its description is not applied to them."""
    return free_motion(robot, SECONDS, RATE, seed=1, noise=noise)


def test_residuals_are_those_of_the_native_observer():
    robot = arm(1, sensors=2)
    s = recorded(robot)
    s.time[1000:] += 0.2  # a gap
    evidence = gather(robot, [[s]], bandwidth=20.0)
    estimate = tl.Observer(robot, bandwidth=20.0, method="paper").run(
        s.time, s.q, s.qd, s.tau, s.wrench
    )
    native = np.concatenate([estimate.tau_ext, estimate.sensor_wrench.reshape(len(s), -1)], axis=1)
    at = np.searchsorted(s.time, evidence.time)
    np.testing.assert_allclose(evidence.residual(), native[at], atol=1e-9)


def test_nothing_is_found_where_nothing_is_wrong():
    found = identify(gather(arm(), [[recorded(arm())]]))
    assert np.abs(found.solution.values).max(initial=0.0) < 0.01
    assert payload_mass(found.solution)[0] == 0.0
    assert (found.after <= 1.01 * found.before).all()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_row_that_one_recording_lacks_counts_in_none(order):
    """Its absence read as zeros would be a load that the arm does not have."""
    robot = arm()
    s = recorded(robot)
    lacking = replace(s, tau=s.tau.copy())
    lacking.tau[:, 1] = np.nan
    evidence = gather(robot, [[(s, lacking)[i]] for i in order])
    assert evidence.used.tolist() == [True, False, True, True, True]
    assert np.abs(evidence.residual()).max() < 0.1
    found = identify(evidence)
    assert payload_mass(found.solution)[0] == 0.0
    assert (found.after <= 1.01 * found.before).all()


def test_friction_and_offsets_are_found_again():
    robot = arm()
    s = recorded(robot)
    truth = [(0.8, 0.05, 0.5, 0.3), (0.0, 0.05, 0.0, -0.2), (1.5, 0.02, 0.0, 0.0)]
    for j, (coulomb, width, viscous, bias) in enumerate(truth):
        s.tau[:, j] += coulomb * np.tanh(s.qd[:, j] / width) + viscous * s.qd[:, j] + bias
    found = identify(gather(robot, [[s]]))
    joints = identified_robot(found).description.joints
    for joint, (coulomb, width, viscous, bias) in zip(joints, truth, strict=False):
        assert joint.friction.coulomb == pytest.approx(coulomb, rel=0.05, abs=0.05)
        assert joint.friction.viscous == pytest.approx(viscous, abs=0.05)
        assert joint.bias == pytest.approx(bias, abs=0.05)
        if coulomb:
            assert joint.friction.coulomb_width == width
    for value, error in zip(found.solution.values, found.solution.errors, strict=True):
        assert error < 0.2 * max(abs(value), 0.5)


def rubbed(s, laws):
    """Samples with friction of the joints."""
    tau = s.tau.copy()
    for j, law in enumerate(laws):
        tau[:, j] += law.dry(s.qd[:, j]) + law.viscous * s.qd[:, j]
    return replace(s, tau=tau)


@pytest.mark.parametrize("seed", range(3))
def test_friction_that_falls_with_speed_is_found_where_there_is_some(seed):
    """Five joints of random widths, every other one with friction that falls."""
    rng, robot, laws = np.random.default_rng(seed), arm(), []
    for j in range(5):
        width, coulomb = np.exp(rng.uniform(*np.log((0.01, 0.05)))), rng.uniform(0.5, 3.0)
        law = Friction(coulomb, rng.uniform(0.0, 1.0), float(width))
        if (j + seed) % 2:
            speed = max(float(np.exp(rng.uniform(*np.log((0.05, 0.4))))), 2.5 * width)
            law = replace(law, stribeck=coulomb * rng.uniform(0.4, 1.2), stribeck_speed=speed)
        laws.append(law)
    s = rubbed(recorded(robot), laws)
    found = identified_robot(identify(gather(robot, [[s]])))
    for joint, law in zip(found.description.joints, laws, strict=True):
        assert joint.friction.stribeck == pytest.approx(law.stribeck, rel=0.1)
        assert joint.friction.coulomb == pytest.approx(law.coulomb, rel=0.05)
        assert joint.friction.coulomb_width == pytest.approx(law.coulomb_width, rel=0.1)
    native = tl.Observer(found, bandwidth=20.0).run(s.time, s.q, s.qd, s.tau, s.wrench)
    assert np.sqrt(np.mean(native.tau_ext[100:] ** 2, axis=0)).max() < 0.02


def test_described_friction_may_be_too_large_and_may_begin_to_fall():
    """Its width stays, and so does its speed once it is described."""
    plain, robot = Friction(2.0, 0.5, 0.05), arm()
    truth = [Friction(1.0, 0.2, 0.05), Friction(1.0, 0.2, 0.05, 0.8, 0.3)]
    s = rubbed(recorded(robot), truth)
    falls = Friction(2.0, 0.5, 0.05, 1.5, 0.3)
    for described in ((plain, plain), (plain, falls)):
        joints = [
            replace(joint, friction=law)
            for joint, law in zip(robot.description.joints, described, strict=False)
        ]
        joints += robot.description.joints[2:]
        rough = Robot(replace(robot.description, joints=tuple(joints)), robot.mechanism)
        found = identified_robot(identify(gather(rough, [[s]]))).description.joints
        assert found[0].friction.coulomb == pytest.approx(1.0, rel=0.05)
        assert found[0].friction.stribeck == 0.0
        assert found[1].friction.coulomb == pytest.approx(1.0, rel=0.05)
        assert found[1].friction.stribeck == pytest.approx(0.8, rel=0.1)
        assert found[1].friction.stribeck_speed == pytest.approx(0.3, rel=0.05)
        assert found[1].friction.coulomb_width == 0.05


def test_any_law_of_dry_friction_comes_from_a_few():
    speed = np.concatenate([-np.geomspace(1e-4, 10.0, 500), [0.0], np.geomspace(1e-4, 10.0, 500)])
    for law in (Friction(1.0, 0.0, 0.005), Friction(1.0, 0.0, 0.03, 2.0, 0.08)):
        np.testing.assert_allclose(spread(speed) @ law.dry(SPEEDS), law.dry(speed), atol=1.5e-3)


def test_rounding_does_not_choose_a_width_where_friction_is_held_at_zero():
    robot = arm()
    s = recorded(robot)
    s.tau[:] -= np.tanh(s.qd / 0.05)  # as if joints were driven by their own motion
    chosen = set()
    for k in range(4):
        other = replace(s, tau=s.tau * (1.0 + k * 1e-14))
        evidence = gather(robot, [[other]])
        chosen.add(Chooser(evidence, np.ones(len(evidence), dtype=bool)).richest().columns)
    assert len(chosen) == 1


def test_rounding_does_not_choose_between_equals():
    """What is held at zero costs nothing, so both are the same: the simpler one is the best."""
    robot = arm()
    evidence = gather(robot, [[recorded(robot)]])
    chooser = Chooser(evidence, np.ones(len(evidence), dtype=bool))
    cost = np.random.default_rng(0).uniform(1.0, 2.0, 20)
    worse, equal = cost + np.linspace(-0.5, 1.0, 20), cost * (1.0 - 1e-15)
    assert chooser._simplest([worse + 1.0, cost, worse, equal]) == 1


def test_a_rotor_is_found_where_the_torque_is_that_of_the_motor():
    robot = arm()
    joints = tuple(replace(joint, torque="motor") for joint in robot.description.joints)
    robot = Robot(replace(robot.description, joints=joints), robot.mechanism)
    s = recorded(robot)
    s.tau[:, 1] += 0.8 * np.gradient(s.qd[:, 1], s.time) + 2.0 * np.tanh(s.qd[:, 1] / 0.05)
    joint = identified_robot(identify(gather(robot, [[s]]))).description.joints[1]
    assert joint.rotor_inertia == pytest.approx(0.8, abs=0.03)
    assert joint.friction.coulomb == pytest.approx(2.0, rel=0.05)


def loaded(robot, mechanism):
    """A robot that moves as a mechanism with 1.2 kg at its end."""
    link = mechanism.links["link5"]
    load = Load("link5", 1.2, (0.05, 0.0, 0.1), (0.004, 0.0, 0.0, 0.004, 0.0, 0.003))
    body = combine_inertias([link.inertia, load_inertia(load)])
    links = mechanism.links | {"link5": replace(link, inertia=body)}
    return Robot(robot.description, replace(mechanism, links=links))


def test_a_payload_is_found_and_the_written_robot_explains_the_motion():
    robot = arm()
    found = identify(gather(robot, [[recorded(loaded(robot, robot.mechanism))]]))
    mass, error = payload_mass(found.solution)
    assert mass == pytest.approx(1.2, abs=0.02) and error < 0.02
    assert "or something that rested on it" in "\n".join(identification_lines(found))
    new = identified_robot(found)
    left = found.evidence.residual(new)
    np.testing.assert_allclose(left, found.left(), atol=1e-3)
    changes = description_changes(robot, new)
    (written,) = changes["loads"]
    assert written["com"] == pytest.approx([0.05, 0.0, 0.1], abs=0.01)


def test_the_error_of_a_payload_counts_that_links_may_be_off():
    """The plain error, of a payload beside links that are right, is far too small."""
    robot = arm()
    others = [name for name in robot.mechanism.links if name != "link5"]
    wrong = perturbed(robot.mechanism, 0.03, np.random.default_rng(0), others)
    found = identify(gather(robot, [[recorded(loaded(robot, wrong))]]))
    mass, error = payload_mass(found.solution)
    assert 0.02 < abs(mass - 1.2) < 3.0 * error


def test_a_bias_of_a_sensor_is_found_while_the_arm_moves():
    robot = arm(2, sensors=1)
    s = recorded(robot)
    bias = np.array([2.0, -1.0, 0.0, 0.3, 0.0, -0.2])
    s.wrench[:, 0] += bias
    sensor = identified_robot(identify(gather(robot, [[s]]))).description.sensors[0]
    np.testing.assert_allclose(sensor.bias, bias, atol=0.1)


def test_touches_are_left_out():
    robot = arm()
    s = recorded(robot)
    s.tau[:, 0] += 0.5 * np.tanh(s.qd[:, 0] / 0.05)
    touched = (s.time % 6.0 > 4.5) & (s.time % 6.0 < 5.5)
    s.tau[touched] += np.array([6.0, 4.0, 3.0, 0.0, 0.0])
    found = identify(gather(robot, [[s]]))
    label = touched[np.searchsorted(s.time, found.evidence.time)]
    assert found.touched[label].mean() > 0.95
    assert found.touched[~label].mean() < 0.15
    joint = identified_robot(found).description.joints[0]
    assert joint.friction.coulomb == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("seed", range(20))
def test_every_step_is_that_of_a_possible_body(seed):
    rng = np.random.default_rng(seed)
    vector = body_vector(arm(seed).nodes[2].inertia)
    body = PhysicalBody(vector)
    step = rng.normal(size=10) * rng.uniform(0.01, 0.7)
    assert np.linalg.eigvalsh(pseudo_inertia(vector + body.change(step))).min() > -1e-9
    assert np.abs(body.change(np.zeros(10))).max() < 1e-12
    J, h = body.jacobian(step), 1e-6
    for i in range(10):
        away = np.eye(10)[i] * h
        slope = (body.change(step + away) - body.change(step - away)) / (2 * h)
        np.testing.assert_allclose(J[:, i], slope, atol=1e-5 * max(1.0, np.abs(J).max()))


def test_parameters_that_are_drawn_by_what_they_cannot_explain_err_elsewhere():
    robot = arm()

    def growth(ripple):
        s = recorded(robot)
        s.tau[:, 1] += ripple * np.sin(4.0 * s.q[:, 1])
        evidence = gather(robot, [[s]])
        chooser = Chooser(evidence, np.ones(len(evidence), dtype=bool))
        return chooser.growth_elsewhere(chooser.fit(chooser.richest(0.03)))

    assert growth(0.0).max() < 1.1
    assert growth(0.5).max() > 1.5
    found = identify(gather(robot, [[recorded(robot)]]))
    left = np.sqrt(np.mean(found.left() ** 2, axis=0))
    assert (found.growth >= found.after / left - 1e-9).all()
