# SPDX-License-Identifier: Apache-2.0
"""Bad samples: they raise a health bit, harm nothing that does not need them, and are got over."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from motion import Recording, ramp
from robots import describe, random_mechanism

from touchline.health import Health
from touchline.model.description import JointDescription, SensorDescription
from touchline.model.robot import Robot
from touchline.observer.observer import Observer

K = 50.0
DT = 1e-3
SETTLING = int(5 / K / DT) + 1  # samples
BAD = (np.nan, np.inf, -np.inf, 1e300, -1e7)
SIGNALS = ("q", "qd", "tau", "wrench")


def make_robot(joints=None, sensors=None):
    """Seven joints in a row, a sensor under the base and one at the tip."""
    mechanism = random_mechanism(np.random.default_rng(11), chain=True)
    rows = sensors or (SensorDescription("base", "link0"), SensorDescription("tip", "link7"))
    return Robot(describe(mechanism, rows, K, joints), mechanism)


ROBOT = make_robot()


class Feed:
    """Smooth signals with some load on everything, by time; no need to be physical."""

    def __init__(self, count=600, dt=DT, start=0.0, seed=0):
        rng = np.random.default_rng(seed)
        self.time = start + np.arange(count) * dt
        wave = np.sin(self.time[:, None] * rng.uniform(1, 3, 7) + rng.uniform(0, 6, 7))
        self.q, self.qd = wave, np.gradient(wave, self.time, axis=0)
        self.tau = 5.0 + wave
        self.wrench = np.stack([20.0 + wave[:, :6], 10.0 - wave[:, 1:]], axis=1)

    def signals(self):
        return self.time, self.q, self.qd, self.tau, self.wrench

    def sample(self, i):
        return tuple(signal[i] for signal in self.signals())

    def run(self, robot=ROBOT, **options):
        return Observer(robot, **options).run(*self.signals())


def known(estimate):
    """All numbers of an estimate but health."""
    return estimate.rows[..., :-1]


def test_clean_samples_are_healthy_once_settled():
    health = Feed().run().health
    assert (health[: SETTLING - 1] == Health.SETTLING).all()
    assert (health[SETTLING:] == 0).all()


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("signal", ["tau", "wrench"])
def test_a_bad_load_marks_its_sample_and_leaves_the_others(signal, bad):
    feed = Feed()
    clean = feed.run()
    getattr(feed, signal)[300].flat[2] = bad
    estimate = feed.run()
    bit = Health.MISSING if np.isnan(bad) else Health.NON_FINITE
    assert estimate.health[300] & bit
    assert (estimate.health[301:] & bit == 0).all()
    assert np.isfinite(estimate.rows[301:]).all()
    if signal == "tau":
        assert np.isnan(estimate.tau_ext[300, 2])
        others = np.arange(7) != 2
        np.testing.assert_array_equal(estimate.tau_ext[:, others], clean.tau_ext[:, others])
        np.testing.assert_array_equal(estimate.segment_wrench, clean.segment_wrench)
    else:
        assert np.isnan(estimate.sensor_wrench[300, 0]).all()
        np.testing.assert_array_equal(estimate.tau_ext, clean.tau_ext)
        np.testing.assert_array_equal(estimate.segment_wrench[:, 1], clean.segment_wrench[:, 1])
    # One lost sample is bridged: what follows hardly differs.
    np.testing.assert_allclose(estimate.tau_ext[301:], clean.tau_ext[301:], atol=1e-2)
    np.testing.assert_allclose(estimate.segment_wrench[301:], clean.segment_wrench[301:], atol=0.05)


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("signal", ["q", "qd"])
def test_a_bad_state_gives_no_estimates_and_is_bridged(signal, bad):
    feed = Feed()
    clean = feed.run()
    getattr(feed, signal)[300, 2] = bad
    estimate = feed.run()
    assert estimate.health[300] == (Health.MISSING if np.isnan(bad) else Health.NON_FINITE)
    assert np.isnan(estimate.tau_ext[300]).all() and np.isnan(estimate.segment_wrench[300]).all()
    assert (estimate.health[301:] == 0).all()
    np.testing.assert_allclose(estimate.tau_ext[301:], clean.tau_ext[301:], atol=1e-2)


def test_one_missing_axis_excludes_only_its_sensor():
    feed = Feed()
    clean = feed.run()
    feed.wrench[200:400, 0, 4] = np.nan
    estimate = feed.run()
    lost, back = slice(200, 400), slice(400 + SETTLING, None)
    assert np.isnan(estimate.segment_wrench[lost, 0]).all()
    assert (estimate.health[lost] & Health.MISSING != 0).all()
    assert (estimate.health[204:400] & Health.SENSOR_EXCLUDED != 0).all()
    assert (estimate.health[400 : 400 + SETTLING - 2] & Health.SETTLING != 0).all()
    assert (estimate.health[back] == 0).all()
    for part in ("tau_ext", "joint_innovation", "segment_torque"):
        a, b = getattr(estimate, part), getattr(clean, part)
        np.testing.assert_allclose(a, b, atol=1e-9)  # none of these needs the base sensor
    np.testing.assert_allclose(estimate.segment_wrench[:, 1], clean.segment_wrench[:, 1], atol=1e-9)
    # After the return the filter starts at zero and forgets that with its time constant.
    error = np.abs(estimate.segment_wrench[back, 0] - clean.segment_wrench[back, 0]).max(axis=1)
    scale = np.abs(clean.segment_wrench).max()
    assert (
        error < scale * np.exp(-K * DT * np.arange(SETTLING, SETTLING + len(error)) * 0.98)
    ).all()


def test_a_missing_tip_sensor_takes_the_base_segment_with_it_but_not_the_sum():
    feed = Feed()
    clean = feed.run()
    feed.wrench[200:400, 1] = np.nan
    estimate = feed.run()
    assert np.isnan(estimate.segment_wrench[200:400]).all()  # the structure ends at the tip sensor
    np.testing.assert_allclose(estimate.tau_ext, clean.tau_ext, atol=1e-9)
    np.testing.assert_allclose(estimate.parity, clean.parity, atol=1e-9)
    assert np.isnan(estimate.segment_torque[200:400]).all()
    # All that the base sensor carries is still known, and so continuous.
    np.testing.assert_allclose(
        estimate.sensor_wrench[200:400, 0], clean.sensor_wrench[200:400, 0], atol=0.2
    )


@pytest.mark.parametrize("method", ["segment", "paper"])
@pytest.mark.parametrize("length", [1, 2, 4, 20, 38, 43, 80])
def test_every_output_recovers_from_a_dropout_of_everything(method, length):
    feed = Feed(1000)
    clean = feed.run(method=method)
    feed.tau[300 : 300 + length] = np.nan
    feed.wrench[300 : 300 + length] = np.nan
    estimate = feed.run(method=method)
    late = slice(300 + length + 3 * SETTLING, None)
    np.testing.assert_allclose(estimate.rows[late], clean.rows[late], atol=2e-4)
    # A gap is bridged up to K dt = 2: 40 ms.
    assert bool((estimate.health[300 + length] & Health.SETTLING) != 0) == (length > 40)


def test_innovations_over_different_intervals_are_not_compared():
    """A lost sample just as a push sets in must not look like a contact beside the sensor."""
    force, point = np.array([30.0, -40.0, 50.0]), np.array([0.3, -0.2, 0.6])
    contact = ("tip", lambda t: point, lambda t: force * ramp(t, 0.0995, 0.001))
    record = Recording(ROBOT, np.arange(0, 0.2, DT), [contact])
    clean = Observer(ROBOT).run(*record.signals())
    record.wrench[100, 0, 2] = np.nan
    estimate = Observer(ROBOT).run(*record.signals())
    assert np.abs(estimate.tau_ext[-1]).min() > 0.5
    assert np.nanmax(np.abs(clean.parity)) < 5e-3
    assert np.nanmax(np.abs(estimate.parity)) < 5e-3


def test_saturation_is_told_and_used():
    rows = tuple(JointDescription(f"joint{i}", range=20.0) for i in range(1, 8))
    sensors = (
        SensorDescription("base", "link0", range=(50.0,) * 6),
        SensorDescription("tip", "link7"),
    )
    robot = make_robot(rows, sensors)
    feed = Feed()
    feed.tau[100, 3], feed.tau[110, 0] = 20.0, -25.0
    feed.wrench[120, 0, 5] = -50.0
    feed.wrench[130, 1, 5] = 500.0  # the tip sensor has no stated range
    health = feed.run(robot).health
    saturated = np.flatnonzero(health & Health.SATURATED)
    assert saturated.tolist() == [100, 110, 120]
    assert np.isfinite(feed.run(robot).tau_ext[110]).all()


def test_a_joint_outside_its_limits_is_told():
    mechanism = random_mechanism(np.random.default_rng(11), chain=True)
    joint = mechanism.joints["joint3"]
    limited = type(joint)(**{**joint.__dict__, "lower": -0.5, "upper": 0.5})
    joints = {**mechanism.joints, "joint3": limited}
    mechanism = type(mechanism)(**{**mechanism.__dict__, "joints": joints})
    feed = Feed()
    feed.wrench = feed.wrench[:, :1]
    health = feed.run(Robot(describe(mechanism, (("base", "link0"),), K), mechanism)).health
    outside = np.abs(feed.q[:, 2]) > 0.51
    np.testing.assert_array_equal(health & Health.MODEL_LIMIT != 0, outside)


@pytest.mark.parametrize("stamp", [0.0, -DT, -1e-12, np.nan, np.inf, -np.inf, 1e-10])
def test_a_bad_time_stamp_drops_its_sample_only(stamp):
    """`stamp`: from the sample before."""
    feed = Feed()
    clean = np.delete(feed.run().rows, 300, axis=0)
    observer, rows = Observer(ROBOT), []
    for i in range(600):
        time = feed.time[299] + stamp if i == 300 else feed.time[i]
        rows.append(observer.update(time, *feed.sample(i)[1:]))
    assert rows[300].health == Health.BAD_TIME
    np.testing.assert_array_equal(known(rows[300]), known(rows[299]))
    assert (np.array([row.health for row in rows[301:]]) == 0).all()
    np.testing.assert_allclose(
        np.array([row.tau_ext for row in rows[301:]]), clean[300:, :7], atol=1e-2
    )


def test_a_clock_set_back_begins_anew():
    first, second = Feed(300, start=1000.0), Feed(600)
    observer = Observer(ROBOT)
    observer.run(*first.signals())
    estimate = observer.run(*second.signals())
    assert estimate.health[0] & Health.BAD_TIME and estimate.health[0] & Health.SETTLING
    np.testing.assert_array_equal(known(estimate), known(second.run()))


def test_a_wrong_first_stamp_does_not_block_what_follows():
    feed = Feed()
    for stamp in (1.0, 1e300, 0.3):
        observer = Observer(ROBOT)
        observer.update(stamp, *feed.sample(0)[1:])
        np.testing.assert_array_equal(known(observer.run(*feed.signals())), known(feed.run()))


def test_a_clock_set_back_a_little_is_followed_after_some_samples():
    feed = Feed()
    observer = Observer(ROBOT)
    slow = Feed(100, dt=0.1)
    observer.run(*slow.signals())  # ends at 9.9 s: 0.3 s back is within three periods
    feed.time += 9.6
    health = observer.run(*feed.signals()).health
    assert (health[:10] & Health.BAD_TIME != 0).all() and (health[10:] & Health.BAD_TIME == 0).all()
    assert health[-1] == 0


@pytest.mark.parametrize("jump", [0.0441, 1.0, 1e6, 1e300])
def test_a_long_gap_restarts_the_filters(jump):
    feed = Feed()
    feed.time[300:] += jump
    estimate = feed.run()
    assert estimate.health[300] & Health.GAP
    np.testing.assert_array_equal(estimate.tau_ext[300], 0.0)
    assert not estimate.joint_settled[300].any()
    if jump < 1e9:  # beyond, the clock itself has no milliseconds left
        assert (estimate.health[301 : 300 + SETTLING - 2] == Health.SETTLING).all()
        assert (estimate.health[300 + SETTLING + 2 :] == 0).all()


def test_up_to_two_lost_samples_are_no_gap():
    feed = Feed()
    keep = np.ones(600, bool)
    keep[[100, 200, 201, 300, 301]] = False
    estimate = Observer(ROBOT).run(*(signal[keep] for signal in feed.signals()))
    assert (estimate.health & Health.GAP == 0).all()
    keep[302] = False
    estimate = Observer(ROBOT).run(*(signal[keep] for signal in feed.signals()))
    assert np.count_nonzero(estimate.health & Health.GAP) == 1


def test_another_rate_is_soon_followed():
    fast, slow = Feed(500), Feed(200, dt=10 * DT, start=0.5 + 9 * DT)
    observer = Observer(ROBOT)
    observer.run(*fast.signals())
    health = observer.run(*slow.signals()).health
    gaps = np.flatnonzero(health & Health.GAP)
    assert gaps.tolist() == list(range(len(gaps))) and 1 <= len(gaps) <= 12
    assert (health[60:] == 0).all()
    back = Feed(500, start=slow.time[-1] + DT)
    assert (observer.run(*back.signals()).health & ~Health.SETTLING == 0).all()


def test_jitter_is_no_gap():
    feed = Feed()
    feed.time = np.cumsum(np.where(np.arange(600) % 2, 1.9e-3, 0.1e-3))
    assert (feed.run().health & Health.GAP == 0).all()
    rng = np.random.default_rng(0)
    feed.time = np.cumsum(rng.uniform(0.2e-3, 1.8e-3, 600))
    assert (feed.run().health & Health.GAP == 0).all()


def test_without_torques_the_wrenches_remain():
    feed = Feed()
    observer = Observer(ROBOT)
    estimate = observer.run(feed.time, feed.q, feed.qd, None, feed.wrench)
    np.testing.assert_array_equal(estimate.segment_wrench, feed.run().segment_wrench)
    assert np.isnan(estimate.tau_ext).all()
    assert (estimate.health & Health.MISSING != 0).all()
    observer.reset()
    single = observer.update(0.0, feed.q[0], feed.qd[0])
    assert np.isnan(single.rows[:-1][: 4 * 7 + 12]).all()


def test_what_is_not_measured_is_ignored():
    kinds = ["none", "sensor", "sensor", "sensor", "sensor", "sensor"]
    rows = [JointDescription(f"joint{i + 1}", kind) for i, kind in enumerate(kinds)]
    rows.append(JointDescription("joint7", "from", ("tip",)))
    axes = ("fx", "fy", "fz", "mx", "my")
    sensors = (
        SensorDescription("base", "link0"),
        SensorDescription("tip", "link7"),
        SensorDescription("few", "link3", axes=axes),
    )
    robot = make_robot(tuple(rows), sensors)
    feed = Feed()
    feed.wrench = np.concatenate([feed.wrench, feed.wrench[:, :1]], axis=1)
    feed.tau[:, [0, 6]] = np.nan
    feed.wrench[:, 2, 5] = np.nan
    clean = feed.run(robot)
    assert (clean.health[SETTLING:] == 0).all()
    assert np.isnan(clean.tau_ext[:, 0]).all() and np.isfinite(clean.tau_ext[:, 6]).all()
    for rubbish in (np.inf, 1e9, 3.0):
        feed.tau[:, [0, 6]] = rubbish
        feed.wrench[:, 2, 5] = rubbish
        np.testing.assert_array_equal(feed.run(robot).rows, clean.rows)


def test_lists_float32_and_strides_give_the_same_numbers():
    feed = Feed(60)
    for name in SIGNALS:
        setattr(feed, name, getattr(feed, name).astype(np.float32).astype(float))
    rows = feed.run().rows
    observers = [Observer(ROBOT) for _ in range(4)]
    for i in range(60):
        time, *signals = feed.sample(i)
        forms = (
            [s.tolist() for s in signals],
            [s.astype(np.float32) for s in signals],
            [np.repeat(s, 2, axis=-1)[..., ::2] for s in signals],
            [np.asfortranarray(s) for s in signals],
        )
        for observer, form in zip(observers, forms, strict=True):
            np.testing.assert_array_equal(observer.update(time, *form).rows, rows[i])
    wide = [np.repeat(s, 2, axis=0)[::2] for s in feed.signals()]
    np.testing.assert_array_equal(Observer(ROBOT).run(*wide).rows, rows)


@pytest.mark.parametrize("name", SIGNALS)
@pytest.mark.parametrize("change", ["shorter", "longer", "flat", "scalar", "deeper"])
def test_a_wrong_shape_names_the_argument(name, change):
    feed = Feed(10)
    for call in ("update", "run"):
        time, *signals = feed.sample(3) if call == "update" else feed.signals()
        signals = dict(zip(SIGNALS, signals, strict=True))
        value = signals[name]
        signals[name] = {
            "shorter": value[..., :-1].copy(),
            "longer": np.concatenate([value, value], axis=-1),
            "flat": value.reshape(-1)[: value.size - 1] if value.ndim < 2 else value.reshape(-1),
            "scalar": np.array(1.0),
            "deeper": value[None].copy(),
        }[change]
        observer = Observer(ROBOT)
        with pytest.raises(ValueError, match=rf"^{name} has shape .*, expected "):
            getattr(observer, call)(time, **signals)
        assert observer.update(*feed.sample(0)).health == Health.SETTLING  # nothing was taken


def test_text_and_ragged_lists_name_the_argument():
    feed = Feed(10)
    time, q, qd, tau, wrench = feed.sample(0)
    with pytest.raises(ValueError, match="^q "):
        Observer(ROBOT).update(time, ["a"] * 7, qd, tau, wrench)
    with pytest.raises(ValueError, match="^wrench "):
        Observer(ROBOT).update(time, q, qd, tau, [[1.0] * 6, [1.0] * 5])
    with pytest.raises(ValueError, match="^time "):
        Observer(ROBOT).update("now", q, qd, tau, wrench)
    with pytest.raises(ValueError, match="^time "):
        Observer(ROBOT).run(feed.time[:, None], *feed.signals()[1:])


def test_an_empty_recording_is_no_rows():
    feed = Feed(10)
    estimate = Observer(ROBOT).run(*(signal[:0] for signal in feed.signals()))
    assert estimate.tau_ext.shape == (0, 7) and estimate.segment_wrench.shape == (0, 2, 6)


numbers = st.one_of(
    st.sampled_from([0.0, 1.0, *BAD, 5e-324, 1e5, 999999.0, -999999.0]),
    st.floats(allow_nan=True, allow_infinity=True),
)
samples = st.tuples(
    st.one_of(numbers, st.floats(-0.01, 0.02)), st.lists(numbers, min_size=33, max_size=33)
)


@pytest.mark.parametrize("method", ["segment", "paper"])
@settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.large_base_example, HealthCheck.data_too_large],
)
@given(garbage=st.lists(samples, min_size=1, max_size=8))
def test_any_garbage_is_got_over(method, garbage):
    """Whatever comes in, nothing is raised, and clean samples lead to a fresh observer's numbers.

    A sample of 999999 rad/s counts as measured and moves a filter by some 1e13 N; that is forgotten
    as exp(-K t), to 1e-6 in 0.9 s.
    """
    observer = Observer(ROBOT, method=method)
    time = 0.0
    for stamp, values in garbage:
        time = time + stamp
        q, qd, tau, wrench = np.split(np.array(values), [7, 14, 21])
        wrench = np.resize(wrench, (2, 6))
        observer.update(time, q, qd, tau, wrench)
    feed = Feed(1500)
    fresh = Observer(ROBOT, method=method)
    expected = fresh.run(*feed.signals()).rows
    rows = observer.run(*feed.signals()).rows
    last = slice(1450, None)
    np.testing.assert_allclose(rows[last], expected[last], atol=1e-6, rtol=1e-6)
