# SPDX-License-Identifier: Apache-2.0
"""The observer on prescribed motions with exact inverse dynamics and known forces."""

import numpy as np
import pytest
from motion import Recording, first_order, ramp
from oracle import PinocchioTwin
from robots import describe, random_mechanism, random_pose, random_robot

from touchline.health import Health
from touchline.model.description import JointDescription, SensorDescription
from touchline.model.robot import Robot, load_robot
from touchline.observer.observer import Observer

K = 50.0
DT = 1e-3
TIME = np.arange(0, 1.2, DT)
FINE = np.arange(0, 1.2, DT / 20)


def chain_robot(bandwidth=K):
    """Seven joints in a row, a sensor under the base and one at the tip, as on SARA."""
    rng = np.random.default_rng(11)
    mechanism = random_mechanism(rng, chain=True)
    sensors = [("base", "link0", (0.1, 0.0, 0.05), (0.3, -0.2, 0.5)), ("tip", "link7")]
    return Robot(describe(mechanism, sensors, bandwidth), mechanism)


def push(direction, start, point):
    """A force that ramps up to `direction` [N] and the fixed point in world where it acts."""
    force = np.asarray(direction, float)
    return (lambda t: np.asarray(point), lambda t: force * ramp(t, start))


def filtered_wrench(direction, start, point):
    """The wrench of `push` about the world origin through the exact first-order filter."""
    force = np.asarray(direction)[None] * ramp(FINE, start)[:, None]
    moment = np.cross(np.asarray(point), force)
    return first_order(TIME, np.hstack([force, moment]), K, FINE)


STRUCTURE = ([12.0, -8.0, 15.0], 0.3, (0.1, 0.2, 0.4))
TIP = ([-20.0, 10.0, 35.0], 0.55, (0.3, -0.2, 0.6))


def recording(robot, structure=True, tip=True, speed=1.0):
    contacts = []
    if structure:
        contacts.append(("joint4", *push(*STRUCTURE)))
    if tip:
        contacts.append(("tip", *push(*TIP)))
    return Recording(robot, TIME, contacts, speed)


def test_two_forces_appear_on_their_segments():
    robot = chain_robot()
    estimate = Observer(robot).run(*recording(robot).signals())
    truth = np.stack([filtered_wrench(*STRUCTURE), filtered_wrench(*TIP)], axis=1)
    error = np.abs(estimate.segment_wrench - truth)
    assert error.max() < 1e-3


def test_a_contact_at_the_tip_leaves_no_ghost_on_the_structure():
    robot = chain_robot()
    record = recording(robot, structure=False, speed=1.5)
    assert np.abs(Observer(robot).run(*record.signals()).segment_wrench[:, 0]).max() < 1e-3
    ghost = Observer(robot, method="paper").run(*record.signals()).segment_wrench[:, 0]
    # (18) subtracts residuals filtered in frames that turn against each other: |w| |F| / K.
    assert np.linalg.norm(ghost[:, :3], axis=1).max() > 0.3


def test_without_contact_every_output_is_zero():
    robot = chain_robot()
    for method in ("segment", "paper"):
        estimate = Observer(robot, method=method).run(*Recording(robot, TIME).signals())
        for part in (estimate.tau_ext, estimate.sensor_wrench, estimate.segment_wrench):
            assert np.nanmax(np.abs(part)) < 1e-3


def test_joint_residuals_do_not_depend_on_the_method():
    robot = chain_robot()
    signals = recording(robot).signals()
    a, b = (Observer(robot, method=m).run(*signals).tau_ext for m in ("segment", "paper"))
    np.testing.assert_allclose(a, b, atol=1e-9)


def test_joint_residuals_are_the_filtered_external_torques():
    robot = chain_robot()
    record = recording(robot)
    estimate = Observer(robot).run(*record.signals())
    truth = first_order(TIME, record.external[:, :7], K, TIME)
    assert np.abs(estimate.tau_ext - truth).max() < 2e-3


def test_own_torque_and_parity_isolate_the_body():
    robot = chain_robot()
    record = recording(robot)  # one push on link 4, one behind the tip sensor
    estimate = Observer(robot).run(*record.signals())
    assert np.abs(estimate.segment_torque[:, 4:]).max() < 2e-3  # joints outboard of link 4
    assert np.abs(estimate.segment_torque[-1, :4]).min() > 0.05
    assert np.abs(estimate.parity[:, :4]).max() < 2e-3  # joints inboard of both contacts
    assert np.abs(estimate.parity[-1, 4:]).min() > 0.05


def test_parity_knows_of_branches_with_sensors_of_their_own():
    """The handle of `sara-full` branches off inboard of joints 6 and 7, and loads the base."""
    robot = load_robot("sara-full")
    point, force = np.array([0.2, 0.1, 0.5]), np.array([3.0, 18.0, -9.0])
    pushes = [
        ("handle", lambda t: point, lambda t: ramp(t, 0.1) * force),
        ("wrist", lambda t: point + 0.1, lambda t: ramp(t, 0.1) * -force),
    ]
    record = Recording(robot, np.arange(0.0, 0.3, 1e-3), pushes)
    estimate = Observer(robot, K).run(*record.signals())
    assert np.abs(estimate.parity).max() < 2e-3
    twin = PinocchioTwin(robot.description, robot.mechanism)
    if_outboard = force @ twin.jacobian_world(record.q[-1], "joint7", point)
    assert np.abs(if_outboard[5:7]).min() > 0.3  # what the base sensor would say of these joints


def test_sensor_wrench_is_the_sum_of_the_outboard_segments():
    robot = chain_robot()
    estimate = Observer(robot).run(*recording(robot).signals())
    T = robot.poses(recording(robot).q[-1])[
        next(i for i, node in enumerate(robot.nodes) if node.sensor == "base")
    ]
    total = estimate.segment_wrench[-1].sum(axis=0)
    R, p = T[:3, :3], T[:3, 3]
    local = np.r_[R.T @ total[:3], R.T @ (total[3:] - np.cross(p, total[:3]))]
    np.testing.assert_allclose(estimate.sensor_wrench[-1, 0], local, atol=1e-9)


@pytest.mark.parametrize("discretization", ["tustin", "exponential"])
def test_halving_the_step_quarters_the_error(discretization):
    robot = chain_robot()
    errors = []
    for dt in (4e-3, 2e-3):
        time = np.arange(0, 1.0, dt)
        record = Recording(robot, time, speed=1.5)
        run = Observer(robot, discretization=discretization).run(*record.signals())
        errors.append(np.abs(run.segment_wrench).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.25)


def test_update_and_run_give_the_same_numbers():
    robot = random_robot(4)
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.5e-3, 1.5e-3, 200))
    signals = [rng.normal(size=s) for s in ((200, 7), (200, 7), (200, 7), (200, 3, 6))]
    signals[2][50:60, 2] = np.nan
    signals[3][80:100, 1] = np.nan
    whole = Observer(robot).run(time, *signals)
    observer = Observer(robot)
    single = [observer.update(t, *(s[i] for s in signals)).rows for i, t in enumerate(time)]
    np.testing.assert_array_equal(whole.rows, np.array(single))


def test_linear_in_the_force_and_superposing():
    robot = chain_robot()
    parts = [recording(robot, tip=False), recording(robot, structure=False), recording(robot)]
    a, b, both = (Observer(robot).run(*r.signals()).segment_wrench for r in parts)
    free = Observer(robot).run(*Recording(robot, TIME).signals()).segment_wrench
    np.testing.assert_allclose(a + b - free, both, atol=1e-9)


def test_a_turned_world_turns_the_result():
    """The same motion described in a world turned about an axis: wrenches turn with it."""
    robot = random_robot(6, bandwidth=K)
    R = random_pose(np.random.default_rng(3))[:3, :3]
    mechanism = robot.mechanism
    rng = np.random.default_rng(5)
    q, qd, tau = rng.normal(size=(3, 50, 7))
    wrench = rng.normal(size=(50, 3, 6))
    time = np.arange(50) * DT
    plain = Observer(robot).run(time, q, qd, tau, wrench)
    turned_gravity = Robot(
        robot.description,
        type(mechanism)(**{**mechanism.__dict__, "gravity": R @ mechanism.gravity}),
    )
    # Turning gravity alone must change the result, by exactly the change of weight.
    other = Observer(turned_gravity).run(time, q, qd, tau, wrench)
    still = np.zeros_like(q)
    weight = [
        Observer(r).run(time, q, still, still, np.zeros_like(wrench)).segment_wrench
        for r in (robot, turned_gravity)
    ]
    np.testing.assert_allclose(
        other.segment_wrench - plain.segment_wrench, weight[1] - weight[0], atol=1e-9
    )


def test_moving_start_has_no_spike():
    robot = chain_robot()
    record = Recording(robot, TIME + 3.0, speed=1.5)
    assert np.abs(record.qd[0]).max() > 1.0
    assert np.abs(Observer(robot).run(*record.signals()).segment_wrench[:100]).max() < 1e-3


def test_from_joints_read_their_sensors():
    robot = chain_robot()
    rows = [JointDescription(f"joint{i}") for i in range(1, 8)]
    rows[0] = JointDescription("joint1", "from", ("base",))
    rows[6] = JointDescription("joint7", "from", ("tip",))
    sara = Robot(
        describe(robot.mechanism, robot.description.sensors, K, tuple(rows)), robot.mechanism
    )
    record = recording(robot)
    tau = record.tau.copy()
    tau[:, [0, 6]] = np.nan
    estimate = Observer(sara).run(record.time, record.q, record.qd, tau, record.wrench)
    full = Observer(robot).run(*record.signals())
    np.testing.assert_allclose(estimate.tau_ext, full.tau_ext, atol=2e-3)
    assert (estimate.health & Health.MISSING == 0).all()
    assert np.isnan(estimate.parity[:, [0, 6]]).all()  # not independent information


def test_sensor_settings_undo_what_they_say():
    """Polarity, bias, log axes and driver compensation, against the plain sensor."""
    robot = chain_robot()
    record = recording(robot)
    base, tip = robot.description.sensors
    bias = (0.4, -0.3, 0.2, 0.05, 0.02, -0.01)
    odd = (
        SensorDescription(base.name, base.link, base.xyz, base.rpy, polarity="inboard", bias=bias),
        SensorDescription(tip.name, tip.link, frame="link3"),
    )
    other = Robot(describe(robot.mechanism, odd, K), robot.mechanism)
    wrench = record.wrench.copy()
    wrench[:, 0] = -(wrench[:, 0] + np.array(bias))
    for i, q in enumerate(record.q):
        T = robot.T_world_links(q)
        R = T["link3"][:3, :3].T @ T["link7"][:3, :3]
        wrench[i, 1] = np.r_[R @ wrench[i, 1, :3], R @ wrench[i, 1, 3:]]
    a = Observer(robot).run(*record.signals())
    b = Observer(other).run(record.time, record.q, record.qd, record.tau, wrench)
    np.testing.assert_allclose(a.segment_wrench, b.segment_wrench, atol=1e-9)


def test_driver_compensation_is_put_back():
    robot = chain_robot()
    record = recording(robot)
    rows = tuple(JointDescription(f"joint{i}", compensated="gravity") for i in range(1, 8))
    sensors = tuple(
        SensorDescription(s.name, s.link, s.xyz, s.rpy, compensated="gravity")
        for s in robot.description.sensors
    )
    tared = Robot(describe(robot.mechanism, sensors, K, rows), robot.mechanism)
    still = np.zeros(7)
    weight = np.array([robot.terms(q, still)[1] for q in record.q])  # n-bar at rest = gravity
    tau = record.tau - weight[:, :7]
    wrench = record.wrench - weight[:, 7:].reshape(-1, 2, 6)
    a = Observer(robot).run(*record.signals())
    b = Observer(tared).run(record.time, record.q, record.qd, tau, wrench)
    np.testing.assert_allclose(a.rows, b.rows, atol=1e-9)
