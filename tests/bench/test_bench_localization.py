# SPDX-License-Identifier: Apache-2.0
"""The localization benchmark, small: signals, places, judgement, tables."""

import csv

import numpy as np
import pytest
from oracle import PinocchioTwin

import touchline as tl
from touchline.bench.localization.columns import wilson
from touchline.bench.localization.course import hands_table
from touchline.bench.localization.credibility import mixture_level
from touchline.bench.localization.matching import distances, match
from touchline.bench.localization.run import Plan, main, run_plan
from touchline.bench.localization.segment_table import segment_tables
from touchline.bench.localization.surface_map import SurfaceMap
from touchline.bench.localization.trial import pair_rank, run_trial
from touchline.bench.localization.trials_file import write_trials
from touchline.errors import InputError
from touchline.localizer.skin import Skin
from touchline.trials.arms import TIERS, load_arm
from touchline.trials.cell import Cell
from touchline.trials.hands import in_cone, tremor
from touchline.trials.scene import make_scene
from touchline.trials.touches import TouchSampler, sample_on_each, touch_loads


def panda(tier=0):
    try:
        return load_arm("panda", tier)
    except InputError as error:
        pytest.skip(str(error))


def test_single_touches_are_found():
    trials = [run_trial(Cell("sara", tier=1), run) for run in range(60)]
    assert sum(trial.found for trial in trials) >= 59
    assert sum(trial.event_found for trial in trials) >= 59
    assert np.median([trial.touches[0].error for trial in trials]) < 1e-3


def test_an_entry_hidden_in_another_link_is_no_explanation():
    """The line goes on into a finger where the hand's mesh covers it, on the same rigid body."""
    panda()
    trial = run_trial(Cell("panda"), 1500)
    assert trial.found and trial.statuses == ("located",)


MISSED = [("panda", 3, 242), ("panda", 3, 358), ("sara", 2, 59)]


@pytest.mark.parametrize(("arm", "tier", "run"), MISSED)
def test_faces_that_the_line_just_misses_are_looked_at(arm, tier, run):
    """The noisy line grazes a neighbouring face, or goes on to another place of the body."""
    if arm == "panda":
        panda()
    trial = run_trial(Cell(arm, tier=tier), run)
    assert trial.found and trial.statuses == ("located",)


@pytest.mark.parametrize("run", [74, 104, 219])
def test_a_third_contact_in_noise_is_no_faulty_channel(run):
    """With the forces of the other two free, one channel explains what it does as well."""
    panda()
    assert run_trial(Cell("panda", 3, tier=3), run).found


def test_statics_are_pinocchios():
    """Weight and touches at rest, against rnea and Jacobians of a tree with free joints."""
    robot = panda()
    twin = PinocchioTwin(robot.description, robot.mechanism)
    for run in range(5):
        scene = make_scene(Cell("panda", 2, begin="together"), run)
        q = scene.signals.q[-1]
        expected = twin.loads(q, 0 * q, 0 * q)
        first = np.r_[scene.signals.tau[0], scene.signals.wrench[0].ravel()]
        np.testing.assert_allclose(first, expected, atol=1e-10)
        for touch, _ in scene.touches:
            outboard = robot.joints_inboard_of(robot.body_of(touch.patch.body))
            body = outboard[-1] if outboard else "base"
            expected -= touch.force @ twin.jacobian_world(q, body, touch.position)
        last = np.r_[scene.signals.tau[-1], scene.signals.wrench[-1].ravel()]
        np.testing.assert_allclose(last, expected, atol=1e-10)


def test_motion_is_pinocchios():
    robot = panda()
    twin = PinocchioTwin(robot.description, robot.mechanism)
    scene = make_scene(Cell("panda", 1, speed=1.0), 3)
    s = scene.signals
    assert np.abs(s.qd).max() == pytest.approx(1.0)
    np.testing.assert_allclose(np.diff(s.q, axis=0), s.qd[1:] * 1e-3, atol=1e-12)
    loads = np.r_[s.tau[20], s.wrench[20].ravel()]  # before the touch
    np.testing.assert_allclose(loads, twin.loads(s.q[20], s.qd[20], 0 * s.q[20]), atol=1e-9)


def test_sampled_touches_can_be_reached():
    robot = tl.load_robot("sara")
    skin = Skin(robot)
    sampler = TouchSampler(skin, np.random.default_rng(3), clearance=0.03)
    for _ in range(15):
        for touch in (touches := sampler.sample_several(2, 20.0)):
            assert np.linalg.norm(touch.force) == pytest.approx(20.0)
            assert -touch.normal @ touch.force / 20.0 >= 1 / np.sqrt(1.25) - 1e-9
            assert touch.position[2] >= 0.0
            assert skin.nearest(touch.q, touch.patch.link, touch.position)[0] < 1e-9
            for way in (touch.normal, -touch.force / 20.0):
                for step in (1e-6, 0.01, 0.0299):
                    assert skin.links_around(touch.q, touch.position + step * way) == []
        assert touches[0].patch.body != touches[1].patch.body


def test_points_are_uniform_over_the_area():
    """Without rules that reject, the share of each link is that of its area."""
    robot = tl.load_robot("sara")
    skin = Skin(robot)
    sampler = TouchSampler(skin, np.random.default_rng(5), clearance=0.0, floor=-9.0)
    sampler._reachable = lambda *args: True
    sampler._free = lambda *args: True
    links = [sampler.sample(20.0).patch.link for _ in range(3000)]
    areas = {p.link: p.surface.areas.sum() for p in skin.patches if p.segment is not None}
    for link, area in areas.items():
        share = area / sum(areas.values())
        assert np.mean([x == link for x in links]) == pytest.approx(share, abs=0.035)


def test_the_loads_of_a_touch_are_its_virtual_work():
    """The joint torques are the force times the Jacobian by finite differences."""
    robot = tl.load_robot("sara-full")
    sampler = TouchSampler(Skin(robot), np.random.default_rng(5), segments=("wrist",))
    touch = sampler.sample(10.0)
    n = len(robot.joint_names)
    loads = touch_loads(robot, touch.q, touch.patch.node, touch.position, touch.force)
    T = robot.poses(touch.q)[touch.patch.node]
    local = np.linalg.inv(T) @ np.append(touch.position, 1.0)
    for j in range(n):
        step = np.eye(n)[j] * 1e-6
        ends = [robot.poses(touch.q + s * step)[touch.patch.node] @ local for s in (-1, 1)]
        column = (ends[1] - ends[0])[:3] / 2e-6
        assert loads[j] == pytest.approx(column @ touch.force, abs=1e-6)


def test_the_description_says_how_noisy_the_sensors_are():
    for tier in (0, 2):
        noise = load_arm("sara", tier).description.noise
        assert set(noise.tau) == {TIERS[tier].torque}
        assert noise.sensors["base"] == (TIERS[tier].force,) * 3 + (TIERS[tier].moment,) * 3
    rest = make_scene(Cell("sara", tier=2), 0).signals
    assert rest.wrench[:50, 0, :3].std(axis=0) == pytest.approx(0.2, rel=0.4)
    assert rest.wrench[:50, 0, 3:].std(axis=0) == pytest.approx(0.05, rel=0.4)
    assert rest.tau[:50, 1].std() == pytest.approx(0.1, rel=0.4)


def test_tiers_and_timing_share_poses_and_places():
    a = make_scene(Cell("sara", 2, 0), 7).touches
    b = make_scene(Cell("sara", 2, 3, begin="together"), 7).touches
    for (one, _), (other, _) in zip(a, b, strict=True):
        np.testing.assert_array_equal(one.position, other.position)


def test_one_contact_on_each_segment_is_as_one():
    """Alone or with others, at the same place of the same pose and with the same noise."""
    plan = Plan(("sara",), (1,), (1,), ("segments",), (0.0, 2.0), runs=3, baselines=())
    trials = [trial for chunk in run_plan(plan, 0) for trial in chunk]
    together = {(t.cell.speed, t.run): t for t in trials if not t.cell.alone}
    alone = [trial for trial in trials if trial.cell.alone]
    assert len(together) == 2 * 3 and len(alone) == 3 * 2 * 3
    for trial in alone:
        (one,) = trial.touches
        other = together[trial.cell.speed, trial.run]
        (same,) = [touch for touch in other.touches if touch.segment == one.segment]
        assert (same.link, same.x, same.y, same.z) == (one.link, one.x, one.y, one.z)
        assert one.found and same.found and trial.found and other.found
        assert abs(same.error - one.error) < 2e-4
    lines = segment_tables(trials, {}).splitlines()
    assert lines[0] == "sara, one contact on each segment, 0.05 N / 0.01 Nm / 0.05 Nm"
    assert lines[2].split()[:6] == ["at", "rest", "base", "alone", "3", "100.00"]
    assert lines[17].split()[:8] == ["2", "rad/s", "every", "all", "at", "once", "9", "100.00"]
    scene = make_scene(Cell("sara", 3, begin="segments"), 0)
    assert [touch.patch.segment for touch, _ in scene.touches] == ["base", "wrist", "handle"]
    assert len({onset for _, onset in scene.touches}) == 1


@pytest.mark.parametrize("run", [36, 104])
def test_joints_beside_a_branch_know_of_its_touch(run):
    """Joints 6 and 7 of `sara-full` are outboard of where the touched handle branches off."""
    trial = run_trial(Cell("sara-full", 3, begin="segments"), run)
    assert [touch.link for touch in trial.touches] == ["link6", "tool", "handle"]
    assert trial.found and set(trial.statuses) == {"located"}


def test_touches_on_each_segment_are_sampled_where_all_can_be_reached():
    """The tool may be below the floor: another pose is drawn."""
    skin = Skin(tl.load_robot("sara"))
    for seed in range(20):
        touches = sample_on_each(("wrist", "base"), skin, np.random.default_rng(seed), 20.0)
        assert [touch.patch.segment for touch in touches] == ["wrist", "base"]
        np.testing.assert_array_equal(touches[0].q, touches[1].q)
        assert min(touch.position[2] for touch in touches) >= 0.0


def test_segments_need_a_six_axis_sensor():
    panda()
    with pytest.raises(InputError, match="--begin segments: panda-torques has no six-axis sensor"):
        Plan(("panda-torques",), begin=("segments",)).cells()
    assert Plan(("panda",), (1, 2), (0,), ("segments",)).cells() == [
        Cell("panda", begin="segments")
    ]


def test_rank_of_pairs():
    robot = tl.load_robot("sara-full")
    assert pair_rank(robot, ["link1", "link5"]) == 10
    assert pair_rank(robot, ["link3", "link2"]) == 7
    assert pair_rank(robot, ["link1", "tool"]) == 0
    assert pair_rank(robot, ["link1"]) == 0
    sixteen = tl.load_robot("sara")
    assert pair_rank(sixteen, ["link1", "link5"]) == 10
    assert pair_rank(sixteen, ["link0", "link5"]) == 10  # joint 1 has no sensor of its own


def test_matching_takes_the_least_sum():
    places = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    assert match(distances(places, [np.array([0.9, 0, 0]), None, np.array([0.1, 0, 0])])) == [2, 0]
    assert match(distances(places, [np.array([0.2, 0, 0])])) == [0, None]
    assert match(distances(places, [])) == [None, None]


def test_credibility_of_truths_from_the_posterior_is_uniform():
    """Places drawn from two normal distributions on two bodies, the wrong body 20 % of the time."""
    chance = np.random.default_rng(0)
    weights = np.array([0.8, 0.2])
    means = np.array([[0.0, 0, 0], [0.1, 0, 0]])
    spread = np.diag([0.01**2, 0.02**2, 0.0])
    covariances = np.array([spread, 4 * spread])
    levels = []
    for _ in range(500):
        k = chance.choice(2, p=weights)
        place = means[k] + chance.normal(size=3) * np.sqrt(np.diag(covariances[k]))
        levels.append(mixture_level(weights, means, covariances, "ab", place, "ab"[k]))
    levels = np.array(levels)
    for share in (0.25, 0.5, 0.9):
        assert np.mean(levels < share) == pytest.approx(share, abs=0.05)
    doubled = [
        mixture_level(weights, means, covariances / 4, "ab", means[0] + 0.02 * x, "a")
        for x in chance.normal(size=(50, 3)) * [0.5, 1, 0]
    ]
    assert np.mean(np.array(doubled) < 0.9) < 0.6  # a posterior that is too sure is seen


def test_regions_of_contacts_on_one_segment_hold_what_they_say():
    panda()
    cells = [Cell("panda", contacts, tier=tier) for contacts, tier in ((2, 3), (3, 2), (3, 3))]
    trials = [run_trial(cell, run) for cell in cells for run in range(30)]
    levels = np.array([touch.level for trial in trials for touch in trial.touches])
    levels = levels[np.isfinite(levels)]
    assert len(levels) > 230
    assert 0.84 < np.mean(levels < 0.9) < 0.96
    assert 0.4 < np.mean(levels < 0.5) < 0.6


def test_wilson_interval():
    low, high = wilson(10, 10)
    assert (low, high) == pytest.approx((0.7225, 1.0), abs=1e-4)  # Wilson 1927, 95 %
    low, high = wilson(5, 10)
    assert (low, high) == pytest.approx((0.2366, 0.7634), abs=1e-4)


def test_processes_do_not_change_the_trials():
    plan = Plan(("sara",), (1, 2), (1,), ("apart",), runs=27, seed=2, baselines=())
    alone = [trial for chunk in run_plan(plan, 0) for trial in chunk]
    shared = [trial for chunk in run_plan(plan, 2) for trial in chunk]
    assert {(t.cell, t.run): repr(t) for t in alone} == {(t.cell, t.run): repr(t) for t in shared}
    assert len(alone) == 54


def test_tables_and_files_hold_every_trial(tmp_path, capsys):
    plan = Plan(("sara",), (1, 2), (0, 1), ("apart", "together"), runs=2, baselines=("first",))
    main(plan, tmp_path, processes=0)
    printed = capsys.readouterr().out
    assert "sara, noise-free" in printed and "Han and Kim" in printed
    assert printed.startswith((tmp_path / "tables.txt").read_text())
    with (tmp_path / "trials.csv").open() as file:
        assert len(list(csv.DictReader(file))) == 2 * 2 * (1 + 2 + 2)
    for name in ("errors_sara", "arm_sara"):
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000


def test_a_later_trial_may_have_more_columns(tmp_path):
    """The particle filter does not run on a moving arm, which may come first."""
    cells = [Cell("sara", tier=1, speed=0.5), Cell("sara", tier=1)]
    write_trials(tmp_path / "trials.csv", [run_trial(cell, 0, 0, ("particles",)) for cell in cells])
    with (tmp_path / "trials.csv").open() as file:
        assert [bool(row["error_particles"]) for row in csv.DictReader(file)] == [False, True]


def test_a_folder_that_cannot_be_made_is_told_before_the_work(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be used as a directory"):
        main(Plan(("sara",), runs=10**6), tmp_path / "file" / "out")


@pytest.mark.parametrize("plan", [Plan(runs=0), Plan(contacts=()), Plan(robots=())])
def test_a_plan_of_nothing_is_refused(plan):
    with pytest.raises(InputError, match="--runs 0: must be at least 1|nothing to run"):
        main(plan)


def test_colours_are_those_of_the_nearest_touches():
    skin = Skin(tl.load_robot("sara"))
    points = np.array([[0.0, 0.0, 0.01 * i] for i in range(40)])
    values = SurfaceMap(skin, ["link3"] * 40, points, np.where(points[:, 2] < 0.2, 1e-3, 1e-2))
    near = values.at("link3", np.array([[0.0, 0.0, 0.02], [0.0, 0.0, 0.37]]))
    np.testing.assert_allclose(near, [1e-3, 1e-2])
    assert np.isnan(values.at("link4", points)).all()


def test_hands_tremble_as_stated_and_stay_in_their_friction_cones():
    time = np.arange(20000) * 1e-3
    change = tremor(time, np.random.default_rng(0))
    assert np.sqrt((change**2).sum(axis=1).mean()) == pytest.approx(2.0, rel=0.1)
    power = (np.abs(np.fft.rfft(change, axis=0)) ** 2).sum(axis=1)
    frequency = np.fft.rfftfreq(len(time), 1e-3)
    inside = (frequency > 0.9) & (frequency < 10.1)
    assert power[inside].sum() > 0.99 * power.sum()
    normal = np.array([0.0, 0.6, 0.8])
    force = in_cone(10.0 * change - 20.0 * normal, normal, 0.5)
    across = force + np.outer(-force @ normal, normal)
    assert (np.linalg.norm(across, axis=1) <= 0.5 * (-force @ normal) + 1e-9).all()
    gentle = in_cone(0.5 * change - 20.0 * normal, normal, 0.5)
    np.testing.assert_allclose(gentle, 0.5 * change - 20.0 * normal)


def test_a_contact_slides_at_the_stated_speed_over_its_link():
    cell = Cell("sara", 2, tier=1, hands="sliding")
    scene = make_scene(cell, 0)
    skin = Skin(load_arm("sara", 1))
    held, slid = scene.places
    assert np.ptp(held, axis=0).max() == 0.0
    steps = np.linalg.norm(np.diff(slid, axis=0), axis=1)
    assert steps.sum() == pytest.approx(0.06, rel=0.1) and steps.max() < 1.5 * 0.15e-3
    touch, _ = scene.touches[1]
    assert max(skin.nearest(touch.q, touch.patch.link, p)[0] for p in slid[::20]) < 1e-6


def test_a_contact_that_slides_beside_one_that_is_held_is_found():
    trial = run_trial(Cell("sara", 2, tier=1, hands="sliding"), 0)
    assert trial.found and trial.events == 2 and trial.course.false == 0
    assert hands_table([trial]).splitlines()[1].split()[-3] == "2.00"


def test_hands_that_are_not_steady_touch_arms_at_rest():
    with pytest.raises(InputError, match="--hands sliding: hands that tremble or slide"):
        Plan(("sara",), (2,), (1,), ("apart",), (1.0,), hands=("sliding",)).cells()


@pytest.mark.parametrize("name, segments", [("panda", ("base",)), ("ur10", ("base", "wrist"))])
def test_an_arm_is_the_one_that_is_described(name, segments):
    assert tuple(load_arm(name, 1).segment_names) == segments  # its description is found
