# SPDX-License-Identifier: Apache-2.0
"""The classical baselines: against the extended observer, the closed form, and their own limits."""

import numpy as np
import pytest
from motion import Recording, ramp
from robots import describe, random_mechanism

from touchline.errors import InputError
from touchline.model.description import Friction, JointDescription, SensorDescription
from touchline.model.robot import Robot
from touchline.observer.classical import (
    ClassicalObserver,
    JointMomentumObserver,
    classical_error,
    tool_wrench,
)
from touchline.observer.dynamics import (
    contact_loads,
    gravity_loads,
    inverse_dynamics,
    point_jacobian,
)
from touchline.observer.observer import Observer
from touchline.trials.fast_motion import fast_motion, two_sensor_arm

K = 50.0
TIME = np.arange(0, 0.8, 1e-3)
SENSORS = (
    SensorDescription("base", "link0", (0.1, 0.0, 0.05), (0.3, -0.2, 0.5)),
    SensorDescription("tip", "link7"),
)


def chain(joints=None, sensors=SENSORS, bandwidth=K):
    mechanism = random_mechanism(np.random.default_rng(11), chain=True)
    return Robot(describe(mechanism, sensors, bandwidth, joints), mechanism)


def joints_with(**settings):
    return tuple(JointDescription(f"joint{i}", **settings) for i in range(1, 8))


def pushed(robot, speed=1.0):
    """Two forces in motion: one on link 4, one behind the tip sensor."""

    def push(force, start, point):
        return lambda t: np.array(point), lambda t: np.array(force) * ramp(t, start)

    contacts = [
        ("joint4", *push([12.0, -8.0, 15.0], 0.2, (0.1, 0.2, 0.4))),
        ("tip", *push([-20.0, 10.0, 35.0], 0.4, (0.3, -0.2, 0.6))),
    ]
    return Recording(robot, TIME, contacts, speed)


@pytest.fixture(scope="module")
def robot():
    return chain()


@pytest.fixture(scope="module")
def record(robot):
    return pushed(robot)


def joint_rows(record):
    return record.time, record.q, record.qd, record.tau


@pytest.mark.parametrize("discretization", ["automatic", "tustin", "exponential"])
def test_joint_residuals_are_those_of_the_extended_observer(robot, record, discretization):
    joint = JointMomentumObserver(robot, discretization=discretization)
    extended = Observer(robot, discretization=discretization).run(*record.signals())
    ours = joint.run(*joint_rows(record)).tau_ext
    np.testing.assert_allclose(ours, extended.tau_ext, atol=1e-9)
    assert np.abs(ours).max() > 1.0


def test_jitter_and_a_gap_are_taken_as_the_extended_observer_takes_them(robot, record):
    keep = np.ones(len(TIME), bool)
    keep[300:350] = False  # 51 ms: both restart
    keep[270:285] = False  # 16 ms: both integrate over it
    keep[np.random.default_rng(0).choice(np.arange(10, 250), 30, replace=False)] = False
    rows = [signal[keep] for signal in record.signals()]
    extended = Observer(robot).run(*rows).tau_ext
    ours = JointMomentumObserver(robot).run(*rows[:4]).tau_ext
    np.testing.assert_allclose(ours, extended, atol=1e-9)
    assert not np.any(ours[np.flatnonzero(keep) == 350])


def test_a_long_recording_is_taken_in_blocks(robot, record, monkeypatch):
    whole = ClassicalObserver(robot).run(*record.signals())
    monkeypatch.setattr("touchline.observer.joint_momentum.BLOCK", 77)
    parts = ClassicalObserver(robot).run(*record.signals())
    for name in ("tau_ext", "acceleration", "sensor_wrench", "segment_wrench"):
        np.testing.assert_allclose(getattr(parts, name), getattr(whole, name), atol=1e-12)


@pytest.mark.parametrize("speed", [0.3, 1.0, 2.0])
def test_the_error_of_the_classical_route_is_its_closed_form(robot, speed):
    record = pushed(robot, speed)
    estimate = ClassicalObserver(robot).run(*record.signals())
    truth_joints = record.external[:, :7]
    truth = record.external[:, 7:].reshape(-1, 2, 6)
    error = estimate.sensor_wrench - truth
    predicted = classical_error(robot, record.q, estimate.tau_ext, truth_joints)
    np.testing.assert_allclose(error, predicted, rtol=1e-9, atol=1e-9)
    assert np.abs(error).max() > 1.0  # the transient of a ramp passes through M^-1


def test_an_unmeasured_joint_torque_disturbs_the_classical_wrenches_only():
    """The paper's figure 4: a couple inside the arm, which no sensor's row feels from outside."""
    arm = two_sensor_arm(K)
    motion = fast_motion(arm, 1000.0, 1.0)
    needed = inverse_dynamics(arm, motion.q, motion.qd, motion.qdd)
    tau = needed.torque.copy()
    tau[:, 4] -= 10.0 * np.sin(2 * np.pi * 2.0 * motion.time)
    signals = motion.time, motion.q, motion.qd, tau, needed.wrench
    classical = np.abs(ClassicalObserver(arm).run(*signals).sensor_wrench[..., :3])
    extended = np.abs(Observer(arm).run(*signals).sensor_wrench[..., :3])
    assert classical.max() > 1.0 > 1e-2 > extended.max()


def test_the_classical_route_has_no_lag_where_the_residual_has_none(robot):
    """A force that the joints do not feel at all: exact at once, the extended one still settles."""
    mechanism = robot.mechanism
    record = Recording(robot, TIME)
    force = np.array([10.0, 5.0, -3.0, 0.0, 0.0, 0.0])
    loads = contact_loads(robot, record.q, "link0", force)
    assert np.abs(loads.torque).max() == 0.0
    wrench = record.wrench - loads.wrench
    estimate = ClassicalObserver(Robot(robot.description, mechanism)).run(
        *joint_rows(record), wrench
    )
    np.testing.assert_allclose(
        estimate.segment_wrench[:, 0], np.tile(force, (len(TIME), 1)), atol=5e-3
    )


def test_accelerations_are_those_of_the_motion(robot):
    record = Recording(robot, TIME)
    estimate = ClassicalObserver(robot).run(*record.signals())
    assert np.abs(estimate.acceleration - record.qdd).max() < 2e-2
    assert np.abs(record.qdd).max() > 2.0


def test_segments_share_out_the_sensors(robot, record):
    estimate = ClassicalObserver(robot).run(*record.signals())
    base = robot.nodes[0].T_parent_node
    total = estimate.segment_wrench.sum(axis=1)
    turned = (base[:3, :3] @ estimate.sensor_wrench[:, 0, :3, None])[..., 0]
    np.testing.assert_allclose(total[:, :3], turned, atol=1e-9)


def test_a_branched_tree_with_a_root_segment_has_the_observers_segments():
    mechanism = random_mechanism(np.random.default_rng(5))
    sensors = [("one", "link2"), ("two", "link7"), SensorDescription("z", "link5", axes=("fz",))]
    robot = Robot(describe(mechanism, sensors, K), mechanism)
    time = TIME[:300]
    record = Recording(robot, time, speed=0.3)
    load = np.array([4.0, -3.0, 2.0, 0.3, 0.2, -0.1])
    loads = contact_loads(robot, record.q, "link7", load)
    signals = [*joint_rows(record)[:3], record.tau - loads.torque, record.wrench - loads.wrench]
    signals[4][:, 2, :2] = signals[4][:, 2, 3:] = np.nan
    ours = ClassicalObserver(robot).run(*signals)
    extended = Observer(robot).run(*signals)
    assert robot.segment_names[-1] == "root"
    np.testing.assert_array_equal(
        np.isnan(ours.segment_wrench[-1]), np.isnan(extended.segment_wrench[-1])
    )
    np.testing.assert_allclose(
        ours.segment_wrench[-1], extended.segment_wrench[-1], atol=0.02, equal_nan=True
    )
    np.testing.assert_allclose(
        ours.sensor_wrench[-1], extended.sensor_wrench[-1], atol=0.02, equal_nan=True
    )


SETTINGS = {
    "signs": {"sign": -1.0, "gain": 0.5, "bias": 0.3},
    "motor": {"torque": "motor", "rotor_inertia": 0.2, "friction": Friction(0.4, 0.7, 0.1)},
    "falling": {"torque": "motor", "friction": Friction(0.4, 0.7, 0.1, 0.3, 0.2)},
    "gravity": {"compensated": "gravity"},
    "model": {"compensated": "model"},
}


@pytest.mark.parametrize("name", SETTINGS)
def test_joint_settings_are_read_as_the_extended_observer_reads_them(record, name):
    robot = chain(joints_with(**SETTINGS[name]))
    extended = Observer(robot).run(*record.signals()).tau_ext
    ours = JointMomentumObserver(robot).run(*joint_rows(record)).tau_ext
    np.testing.assert_allclose(ours, extended, atol=1e-9)


def test_settings_undone_leave_the_classical_route_as_it_was(robot, record):
    """Torques on the motor side, less weight, and sensors in odd axes: the same wrenches."""
    friction = Friction(0.4, 0.7, 0.1)
    joints = joints_with(
        torque="motor", rotor_inertia=0.2, friction=friction, compensated="gravity", bias=0.3
    )
    base, tip = SENSORS
    bias = (0.4, -0.3, 0.2, 0.05, 0.02, -0.01)
    sensors = (
        SensorDescription(base.name, base.link, base.xyz, base.rpy, polarity="inboard", bias=bias),
        SensorDescription(tip.name, tip.link, frame="link3", compensated="gravity"),
    )
    odd = chain(joints, sensors)
    lost = 0.4 * np.tanh(record.qd / 0.1) + 0.7 * record.qd
    weight = gravity_loads(robot, record.q)
    tau = record.tau + 0.2 * record.qdd + lost - weight.torque + 0.3
    wrench = record.wrench.copy()
    wrench[:, 0] = -(wrench[:, 0] + np.array(bias))
    wrench[:, 1] -= weight.wrench[:, 1]
    for i, q in enumerate(record.q):
        T = robot.T_world_links(q)
        R = T["link3"][:3, :3].T @ T["link7"][:3, :3]
        wrench[i, 1] = np.r_[R @ wrench[i, 1, :3], R @ wrench[i, 1, 3:]]
    estimate = ClassicalObserver(odd).run(record.time, record.q, record.qd, tau, wrench)
    truth = record.external[:, 7:].reshape(-1, 2, 6)
    predicted = classical_error(odd, record.q, estimate.tau_ext, record.external[:, :7])
    np.testing.assert_allclose(estimate.sensor_wrench - truth, predicted, rtol=1e-9, atol=1e-9)


def test_a_joint_without_a_torque_is_nan_or_refused(record):
    rows = list(joints_with())
    rows[2] = JointDescription("joint3", torque="none")
    rows[0] = JointDescription("joint1", torque="from", sources=("base",))
    rows[5] = JointDescription("joint6", compensated="model")
    robot = chain(tuple(rows))
    tau = record.tau.copy()
    tau[:, [0, 2]] = np.nan
    r = JointMomentumObserver(robot).run(record.time, record.q, record.qd, tau).tau_ext
    np.testing.assert_array_equal(np.isnan(r).all(axis=0), np.isin(range(7), [0, 2]))
    assert np.isfinite(r[:, [1, 3, 4, 5, 6]]).all()
    with pytest.raises(InputError) as caught:
        ClassicalObserver(robot)
    assert len(caught.value.problems) == 3
    assert "joint3.torque is 'none'" in str(caught.value)


def test_bad_input_is_named(robot, record):
    observer = ClassicalObserver(robot)
    signals = list(record.signals())
    for index, at, message in (
        (0, 5, "time, row 5"),
        (3, (7, 2), "tau.joint3, row 7: nan"),
        (1, (4, 0), "q.joint1, row 4"),
    ):
        broken = [np.array(signal) for signal in signals]
        broken[index][at] = np.nan
        with pytest.raises(InputError, match=message):
            observer.run(*broken)
    with pytest.raises(InputError, match=r"wrench has shape \(800, 6\), expected \(800, 2, 6\)"):
        observer.run(*signals[:4], signals[4][:, 0])
    with pytest.raises(ValueError, match="discretization is 'euler', allowed: automatic"):
        ClassicalObserver(robot, discretization="euler")
    with pytest.raises(ValueError, match="bandwidth is 0"):
        ClassicalObserver(robot, bandwidth=0)


def test_a_lost_wrench_costs_only_that_instant(robot, record):
    wrench = record.wrench.copy()
    wrench[100, 1] = np.nan
    whole = ClassicalObserver(robot).run(*record.signals())
    part = ClassicalObserver(robot).run(*joint_rows(record), wrench)
    assert np.isnan(part.segment_wrench[100]).all() and np.isnan(part.sensor_wrench[100, 1]).all()
    np.testing.assert_array_equal(part.sensor_wrench[:, 0], whole.sensor_wrench[:, 0])
    rest = np.arange(len(TIME)) != 100
    np.testing.assert_array_equal(part.segment_wrench[rest], whole.segment_wrench[rest])


@pytest.mark.parametrize("body", range(8))
def test_the_rank_of_the_tool_wrench_is_that_of_the_joints_below(robot, body):
    q = np.random.default_rng(body).normal(size=(20, 7))
    result = tool_wrench(robot, q, np.ones((20, 7)), f"link{body}", (0.1, 0.0, 0.2))
    np.testing.assert_array_equal(result.rank, np.full(20, min(body, 6)))
    assert (result.condition[result.rank > 0] >= 1.0).all()
    assert np.isnan(result.condition[result.rank == 0]).all()


def test_beyond_joint_six_the_tool_wrench_is_the_contact(robot):
    rng = np.random.default_rng(3)
    q, point = rng.normal(size=(50, 7)), np.array([0.1, 0.02, 0.2])
    truth = rng.normal(size=(50, 6)) * 10
    residual = np.einsum("...ij,...i->...j", point_jacobian(robot, q, "link7", point), truth)
    result = tool_wrench(robot, q, residual, "link7", point)
    np.testing.assert_allclose(result.wrench, truth, atol=1e-9)


def test_below_joint_six_only_part_of_the_contact_is_seen(robot):
    rng = np.random.default_rng(4)
    q, truth = rng.normal(size=(50, 7)), rng.normal(size=(50, 6)) * 10
    J = point_jacobian(robot, q, "link4", np.zeros(3))
    residual = np.einsum("...ij,...i->...j", J, truth)
    result = tool_wrench(robot, q, residual, "link4")
    explained = np.einsum("...ij,...i->...j", J, result.wrench)
    np.testing.assert_allclose(explained, residual, atol=1e-9)
    assert np.linalg.norm(result.wrench - truth, axis=1).min() > 0.5
    size, true_size = (np.linalg.norm(x, axis=1) for x in (result.wrench, truth))
    assert (size < true_size).all()  # the smallest explanation


def test_an_unmeasured_joint_lowers_the_rank(robot):
    residual = np.ones(7)
    residual[[1, 4]] = np.nan
    result = tool_wrench(robot, np.full(7, 0.4), residual, "link7")
    assert result.rank == 5
    assert np.isfinite(result.wrench).all()


def test_a_singular_posture_costs_rank_and_its_neighbourhood_condition():
    arm = two_sensor_arm()
    straight, bent = np.zeros(7), np.full(7, 0.6)
    near = straight + 1e-4 * bent
    torque = np.arange(1.0, 8.0)
    results = [tool_wrench(arm, q, torque, "tool") for q in (straight, near, bent)]
    # Straight up, four axes coincide and the other three are parallel in one plane: 1 + 2.
    assert [int(result.rank) for result in results] == [3, 6, 6]
    assert results[1].condition > 1e3 * results[2].condition
    assert np.linalg.norm(results[1].wrench) > 1e3 * np.linalg.norm(results[2].wrench)


def test_an_unknown_link_is_named(robot):
    with pytest.raises(InputError, match="link is 'hand', allowed: link0"):
        tool_wrench(robot, np.zeros(7), np.zeros(7), "hand")
