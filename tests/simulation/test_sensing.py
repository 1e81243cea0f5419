# SPDX-License-Identifier: Apache-2.0
"""A log is as its description says: signs, frames, compensation, noise, faults."""

from dataclasses import replace

import numpy as np
import pytest
from robots import describe, random_mechanism
from simulation_support import estimate, force_errors, true_segment_wrench

from touchline.model.description import Friction
from touchline.model.mechanism import Mimic
from touchline.model.robot import Robot
from touchline.simulation.contacts import Profile, ScriptedContact
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import free_motion, scripted
from touchline.simulation.scene import Run

PUSHES = [
    ScriptedContact("link3", [0.05, 0.0, 0.1], [20, 5, -7], Profile(0.05)),
    ScriptedContact("tool", [0.0, 0.0, 0.1], [10, 5, 17], Profile(0.08), moment=[0.2, 0, 0.4]),
]


def with_joints(robot, **changes):
    joints = tuple(replace(joint, **changes) for joint in robot.description.joints)
    return Robot(replace(robot.description, joints=joints), robot.mechanism)


def with_sensors(robot, **changes):
    sensors = tuple(replace(sensor, **changes) for sensor in robot.description.sensors)
    return Robot(replace(robot.description, sensors=sensors), robot.mechanism)


@pytest.fixture(scope="module")
def full():
    import touchline as tl

    return tl.load_robot("sara-full")


@pytest.fixture(scope="module")
def reference(full):
    simulated = scripted(full, PUSHES, 0.3, speed=1.0)
    return simulated, estimate(full, simulated.samples)


ODD_JOINTS = [
    {"sign": -1.0, "gain": 0.25, "bias": 1.5},
    {"compensated": "gravity", "gain": 10.0},
    {"friction": Friction(1.0, 0.5, 0.02)},
    {"friction": Friction(1.0, 0.5, 0.02, stribeck=0.8, stribeck_speed=0.2)},
    {"compensated": "model", "sign": -1.0},
]
ODD_SENSORS = [
    {"polarity": "inboard", "bias": (1.0, -2.0, 3.0, 0.1, 0.2, -0.3)},
    {"frame": "world", "compensated": "gravity"},
    {"frame": "link3", "polarity": "inboard", "bias": (1.0, -2.0, 3.0, 0.1, 0.2, -0.3)},
    {"xyz": (0.02, -0.01, 0.03), "rpy": (0.4, -0.7, 1.1)},
]


@pytest.mark.parametrize(
    ("change", "settings"),
    [(with_joints, c) for c in ODD_JOINTS] + [(with_sensors, c) for c in ODD_SENSORS],
)
def test_odd_conventions_change_the_log_but_not_the_estimates(full, reference, change, settings):
    plain, expected = reference
    odd = change(full, **settings)
    simulated = scripted(odd, PUSHES, 0.3, speed=1.0)
    signal = "tau" if change is with_joints else "wrench"
    difference = getattr(simulated.samples, signal) - getattr(plain.samples, signal)
    assert np.abs(difference).max() > 0.5
    found = estimate(odd, simulated.samples)
    # `model` leaves the driver's own residual, which is exact; the others are only rounded.
    tolerance = 5e-3 if settings.get("compensated") == "model" else 1e-8
    np.testing.assert_allclose(found.tau_ext, expected.tau_ext, atol=tolerance)
    np.testing.assert_allclose(found.segment_wrench, expected.segment_wrench, atol=1e-8)


@pytest.mark.parametrize("law", [Friction(3.0, 2.0, 0.02), Friction(2.0, 2.0, 0.02, 1.5, 0.3)])
def test_motor_side_torques_show_rotor_and_friction(full, law):
    motor = {"torque": "motor", "rotor_inertia": 0.3, "friction": law}
    robot = with_joints(full, **motor)
    simulated = scripted(robot, PUSHES, 0.3, speed=1.0)
    link_side = scripted(full, PUSHES, 0.3, speed=1.0)
    assert np.abs(simulated.samples.tau - link_side.samples.tau).max() > 3.0
    torque = estimate(robot, simulated.samples).tau_ext
    expected = estimate(full, link_side.samples).tau_ext
    np.testing.assert_allclose(torque, expected, atol=0.25)  # the rotors change the motion a little
    quiet = free_motion(robot, 0.3, 1.0)
    assert np.abs(estimate(robot, quiet.samples).tau_ext).max() < 0.02


def test_mimicking_joints_and_branches_leave_no_residual():
    mechanism = random_mechanism(np.random.default_rng(5))
    mimic = replace(mechanism.joints["joint5"], mimic=Mimic("joint2", -0.5, 0.2))
    mechanism = replace(mechanism, joints={**mechanism.joints, "joint5": mimic})
    description = describe(mechanism, [("a", "link0"), ("b", "link4")])
    joints = tuple(j for j in description.joints if j.name != "joint5")
    noise = replace(description.noise, q=(0.0,) * 6, qd=(1e-4,) * 6, tau=(0.01,) * 6)
    description = replace(
        description, joints=joints, noise=noise, bandwidth_joints=(50.0,) * len(joints)
    )
    robot = Robot(description, mechanism)
    simulated = free_motion(robot, 0.3, 0.5)
    found = estimate(robot, simulated.samples)
    assert np.abs(simulated.samples.wrench[:, 0]).max() > 50
    assert np.abs(found.segment_wrench).max() < 0.01
    assert np.abs(found.tau_ext).max() < 0.01


def test_a_link_side_torque_does_not_show_the_rotor(full):
    from touchline.simulation.control import ComputedTorque, sinusoids
    from touchline.simulation.plant import Plant
    from touchline.simulation.sensing import sense
    from touchline.simulation.setup import read_setup
    from touchline.simulation.simulator import run

    home = read_setup(full).home
    trajectory = sinusoids(home, np.full(7, 0.1), np.full(7, 8.0), np.zeros(7))
    plant = Plant(full, armature=dict.fromkeys(full.joint_names, 0.3))
    plant.reset(home, trajectory(0.0).qd)
    readings, _ = run(plant, ComputedTorque(trajectory), seconds=0.3)
    assert np.abs(readings.motor_torque - readings.link_torque).max() > 1.0
    assert np.abs(estimate(full, sense(full, readings)).tau_ext).max() < 0.01


def test_delays_of_the_description_are_those_that_the_log_reader_undoes(full, tmp_path):
    from touchline.logs import read_log, write_table

    late = with_sensors(with_joints(full, delay=0.003), delay=0.002)
    simulated, plain = (scripted(robot, PUSHES, 0.3, speed=1.0) for robot in (late, full))
    assert np.abs(simulated.samples.tau - plain.samples.tau).max() > 0.3
    write_table(tmp_path / "late.parquet", simulated.samples, late.description)
    read = read_log(tmp_path / "late.parquet", late.description)
    own = slice(0, -10)
    np.testing.assert_allclose(read.tau[own], plain.samples.tau[own], atol=1e-9)
    np.testing.assert_allclose(read.wrench[own], plain.samples.wrench[own], atol=1e-9)


def test_readings_stop_at_the_range(full):
    simulated = scripted(with_sensors(full, range=(50.0,) * 6), PUSHES, 0.02)
    assert np.abs(simulated.samples.wrench[:, 0]).max() == pytest.approx(50.0)


@pytest.mark.parametrize("rate", [500.0, 2000.0])
def test_white_noise_has_its_sigma_at_1_khz_and_grows_with_the_rate(sara, rate):
    clean, noisy = (
        scripted(sara, [], 1000 / rate, settings=Run(rate=rate, physics=2000.0, noise=noise))
        for noise in (None, SensorNoise())
    )
    scale = np.sqrt(rate / 1000.0)
    for signal, part, sigma in (
        ("wrench", np.s_[..., :3], 0.05),
        ("wrench", np.s_[..., 3:], 0.01),
        ("tau", np.s_[:, 1:5], 0.05),
        ("qd", np.s_[:], 2e-4),
    ):
        error = getattr(noisy.samples, signal)[part] - getattr(clean.samples, signal)[part]
        assert np.std(error) == pytest.approx(sigma * scale, rel=0.05)
    error = noisy.samples.q - clean.samples.q
    assert 0 < np.abs(error).max() <= np.pi / 2**20 * 1.0001


def test_biases_drifts_crosstalk_delays_and_dropouts_can_be_switched_on(sara):
    quiet = dict(force=0.0, moment=0.0, torque=0.0, velocity=0.0, position_bits=0)
    clean = scripted(sara, PUSHES, 0.3).samples

    def differs(signal, **fault):
        noise = SensorNoise(**quiet, **fault)
        faulty = scripted(sara, PUSHES, 0.3, settings=Run(noise=noise)).samples
        return getattr(faulty, signal) - getattr(clean, signal)

    bias = differs("wrench", force_bias=1.0)
    assert np.ptp(bias, axis=0).max() < 1e-9 and np.abs(bias[..., :3]).max() > 0.5
    drift = differs("tau", torque_drift=0.5)[:, 1:5]
    assert np.abs(drift[0]).max() < 1e-9 < 0.05 < np.abs(drift[-1]).max()
    assert 0.1 < np.abs(differs("wrench", crosstalk=0.01)).max() < 30
    late = differs("wrench", wrench_delay=0.01)
    assert np.abs(late).max() > 1.0 and not differs("wrench").any()
    lost = np.isnan(differs("wrench", dropout_rate=10.0))
    assert 0.01 < lost.mean() < 0.9
    assert (lost.all(axis=2) == lost.any(axis=2)).all()  # a sensor is silent as a whole


def test_errors_of_the_model_show_as_residuals(sara):
    wrong = free_motion(sara, 0.3, settings=Run(model_error=0.02))
    assert 0.2 < np.abs(estimate(sara, wrong.samples).segment_wrench[..., :3]).max() < 50


def test_moments_and_forces_fixed_to_the_link_are_in_the_truth(full, reference):
    simulated, found = reference
    error = found.segment_wrench - true_segment_wrench(full, simulated)
    assert np.abs(error).max() < 0.01
    turning = [
        ScriptedContact("link5", [0, -0.06, 0.1], [0, 20, 0], Profile(0.05), force_frame="link"),
        ScriptedContact(
            "tool", [0.6, 0, 0.5], [0, 0, 10], Profile(0.05, shape="ramp"), point_frame="world"
        ),
    ]
    moving = scripted(full, turning, 0.3, speed=1.0)
    assert np.ptp(moving.truth.force[100:, 0], axis=0).max() > 1.0
    assert np.ptp(moving.truth.point[100:, 1], axis=0).max() == 0.0
    assert force_errors(full, moving).max() < 0.02
