# SPDX-License-Identifier: Apache-2.0
"""`touchline calibrate`: from contact-free recordings to a description, and what it refuses."""

import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from free_motion import exact_loads, free_motion

import touchline as tl
from touchline.calibrate import run
from touchline.calibrate.blame import Blame
from touchline.calibrate.noise import NoiseMeter
from touchline.calibrate.run import _check_tails, calibrate
from touchline.cli.main import main
from touchline.detector.calibration import collect_residuals, fit_growth
from touchline.detector.detector import Detector
from touchline.detector.tail import Tail
from touchline.detector.thresholds import make_thresholds, row_name
from touchline.errors import InputError
from touchline.logs import write_table
from touchline.model.description import LevelDescription
from touchline.model.robot import Robot
from touchline.model.robot_file import write_description
from touchline.model.values import METHODS
from touchline.model.yaml_file import read_yaml
from touchline.observer.samples import Samples
from touchline.trials.free_motion import (
    MotionMaker,
    generator,
    imperfect,
    random_trajectory,
)

RATE = 500.0
TEXT = """\
# An arm.
name: arm      # with a comment
model: robot:sara
observer: {bandwidth: 80.0}

# What its sensors do.
noise: {qd: 1.0e-3, tau: 0.2}
detection:
  # found by hand
  hold: 0.2          # quiet for so long
  contact: {force: 5.0}
# The end.
"""


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara")


@pytest.fixture(scope="module")
def maker(robot):
    return MotionMaker(robot, imperfect(robot, 0.02, 1), RATE, 20.0)


@pytest.fixture(scope="module")
def logs(robot, maker, tmp_path_factory):
    folder, paths = tmp_path_factory.mktemp("free"), []
    for i in range(3):
        rng = generator(i)
        path = folder / f"free{i}.parquet"
        write_table(path, maker.samples(random_trajectory(robot, rng), rng), robot.description)
        paths.append(path)
    rng = generator(0)
    s = MotionMaker(robot, robot, RATE, 10.0).samples(random_trajectory(robot, rng), rng)
    write_table(folder / "short.parquet", s, robot.description)
    return paths


@pytest.fixture(scope="module")
def result(logs, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "sara.yaml"
    return calibrate(logs, "sara", out, ("glrt", "rows"), 10.0)


def test_noise_figures_are_those_of_the_sensors(robot, result):
    given = robot.description.noise
    np.testing.assert_allclose(result.noise.qd, given.qd, rtol=0.03)
    for joint in (1, 2, 3, 4):
        assert result.noise.tau[joint] == pytest.approx(given.tau[joint], rel=0.03)
    for name, six in given.sensors.items():
        np.testing.assert_allclose(result.noise.sensors[name], six, rtol=0.03)


def test_the_written_description_is_calibrated(result):
    again = tl.load_robot(result.out)
    assert again.description.detection.method == ("glrt", "rows")
    thresholds = make_thresholds(again, 1 / RATE)
    assert thresholds.calibrated and thresholds.note is None
    assert set(thresholds.limits) == {"glrt", "rows"}
    assert np.isfinite(thresholds.limits["glrt"]).all()
    strict = replace(again.description.detection, false_alarms=0.1)
    robot = tl.model.robot.Robot(replace(again.description, detection=strict), again.mechanism)
    stricter = make_thresholds(robot, 1 / RATE)
    assert (stricter.limits["glrt"] > thresholds.limits["glrt"]).all()
    assert stricter.rows[0].contact > thresholds.rows[0].contact


def test_a_calibration_holds_for_its_rate_alone(result):
    thresholds = make_thresholds(tl.load_robot(result.out), 1e-4)
    assert not thresholds.calibrated
    assert "calibrated at 500 Hz, not at 10000 Hz" in str(thresholds.note)


def test_at_another_rate_errors_of_the_model_are_still_no_contact(result):
    robot = tl.load_robot(result.out)
    calibrated, slow = make_thresholds(robot, 1 / RATE), make_thresholds(robot, 1 / 15.0)
    for own, row in zip(calibrated.rows, slow.rows, strict=True):
        assert row.contact >= 0.999 * own.contact and row.collision >= row.contact
    given = replace(robot.description.detection, contact=LevelDescription(torque=0.7))
    told = tl.model.robot.Robot(replace(robot.description, detection=given), robot.mechanism)
    rows = make_thresholds(told, 1 / 15.0).rows
    assert {row.contact for row in rows if row.component < 0} == {0.7}


def test_alarms_of_the_detector_at_work_are_as_many_as_foreseen(robot, maker, result):
    again = tl.load_robot(result.out)
    rate = 360.0  # an hour
    loose = replace(again.description.detection, false_alarms=rate)
    for method in ("glrt", "cusum"):
        detection = replace(loose, method=(method,))
        tested = tl.model.robot.Robot(
            replace(again.description, detection=detection), again.mechanism
        )
        alarms, seconds = 0, 0.0
        for i in range(10, 16):
            rng = generator(i)
            s = maker.samples(random_trajectory(robot, rng), rng)
            levels = (
                Detector(tl.Observer(tested), period=1 / RATE)
                .details(s.time, s.q, s.qd, s.tau, s.wrench)
                .levels
                > 0
            )
            alarms += int((levels[1:] & ~levels[:-1]).sum())
            seconds += 20.0
        expected = rate * seconds / 3600  # 12
        assert expected / 3 < alarms < 3 * expected


def test_the_report_tells_what_was_extrapolated(result):
    from touchline.calibrate.summary import summary_text

    text = summary_text(result)
    assert "extrapolated" in text
    assert "held-out data (every 3rd recording held out, 0.3 min)" in text
    assert {h.method for h in result.thresholds.held_out} == set(METHODS)


def test_the_report_tells_what_every_row_is_like(result):
    from touchline.calibrate.summary import summary_text

    lines = {line.split()[0]: line.split() for line in summary_text(result).splitlines() if line}
    thresholds = make_thresholds(tl.load_robot(result.out), 1 / RATE)
    contacts = {row_name(result.robot, row): row.contact for row in thresholds.rows}
    for name in ("joint2", "base.fx", "handle.mz"):
        assert float(lines[name][3]) == pytest.approx(contacts[name], rel=0.01)
        assert float(lines[name][1]) < float(lines[name][3])
    # A third of 60 s: 10 alarms are expected at 1800 an hour, if the tails reach so far.
    most = max(h.rate for h in result.thresholds.held_out)
    assert 100 < most <= 1800
    assert {h.rate for h in result.thresholds.held_out} == {most, 10.0}


def test_the_report_tells_how_much_of_the_postures_was_seen(result):
    from touchline.calibrate.summary import summary_text

    found, joints = result.identification, result.robot.mechanism.joints
    ways = np.ptp(found.evidence.q[~found.touched], axis=0)
    limits = [joints[name] for name in result.robot.joint_names]
    turns = np.array([min(j.upper, np.pi) - max(j.lower, -np.pi) for j in limits])
    text, shares = summary_text(result), 100.0 * ways / turns
    assert f"joints moved over {shares.min():.0f} to {shares.max():.0f} % of their ranges" in text
    assert f"least {result.robot.joint_names[shares.argmin()]};" in text
    assert f"{found.growth[found.evidence.used][0]:.2f} times" in text


def test_a_figure_shows_what_was_seen(result, tmp_path):
    pytest.importorskip("matplotlib")
    from touchline.calibrate.figure import check_figure, draw_calibration

    path = tmp_path / "new" / "tails.svg"
    base = replace(result.thresholds, tails={"base": result.thresholds.tails["base"]})
    draw_calibration(replace(result, thresholds=base), path)
    assert path.read_text().count('id="axes_') == len(METHODS)
    with pytest.raises(InputError, match="allowed endings"):
        check_figure(tmp_path / "tails.txt")


def test_comments_and_other_keys_stay(tmp_path):
    source = tmp_path / "robot.yaml"
    source.write_text(TEXT)
    write_description(
        source,
        source,
        {"noise": {"qd": [1e-4, 2e-4]}, "detection": {"calibration": {"hours": 2.0}, "hold": 0.3}},
    )
    text = source.read_text()
    for kept in (
        "# An arm.",
        "# with a comment",
        "# What its sensors do.",
        "# found by hand",
        "# The end.",
        "observer: {bandwidth: 80.0}",
        "  contact: {force: 5.0}",
    ):
        assert kept in text
    data = read_yaml(source)
    assert data["noise"] == {"qd": [1e-4, 2e-4], "tau": 0.2}
    assert data["detection"]["hold"] == 0.3
    assert data["detection"]["calibration"] == {"hours": 2.0}
    once = text
    write_description(source, source, {"detection": {"hold": 0.3}})
    assert source.read_text() == once


def test_relative_paths_hold_from_the_new_place(tmp_path):
    (tmp_path / "a").mkdir()
    source, out = tmp_path / "a" / "robot.yaml", tmp_path / "b" / "new.yaml"
    source.write_text("name: x\nmodel: ../m/arm.urdf\npackage_dirs: [.]\n")
    write_description(source, out, {"noise": {"qd": 1e-4}})
    data = read_yaml(out)
    assert (out.parent / data["model"]).resolve() == (tmp_path / "m" / "arm.urdf").resolve()
    assert (out.parent / data["package_dirs"][0]).resolve() == source.parent.resolve()


def test_what_is_left_is_learned_and_written_beside_the_description(robot, tmp_path, capsys):
    def rippled(noise):
        s = free_motion(robot, 24.0, 100.0, seed=1, noise=noise)
        s.tau[:, 2] += 0.6 * np.sin(4.0 * s.q[:, 2])
        return s

    log = tmp_path / "log.parquet"
    write_table(log, rippled(0.02), robot.description)
    out = tmp_path / "new.yaml"
    arguments = [str(log), "--robot", "sara", "--out", str(out), "--learn"]
    assert main(["calibrate", *arguments]) == 0
    assert "learned beside it, by joint" in capsys.readouterr().out
    assert read_yaml(out)["learned_rest"] == "new_rest.csv"
    learned = tl.load_robot(out)
    assert learned.description.joints[2].rest is not None
    s = rippled(0.0)
    plain = Robot(
        replace(
            learned.description,
            joints=tuple(replace(j, rest=None) for j in learned.description.joints),
        ),
        learned.mechanism,
    )
    left = [
        tl.Observer(r, bandwidth=20.0).run(s.time, s.q, s.qd, s.tau, s.wrench).tau_ext[100:, 2]
        for r in (plain, learned)
    ]
    assert np.std(left[1]) < 0.5 * np.std(left[0])


def test_gains_of_motors_are_found_and_all_is_pictured(robot, tmp_path, capsys):
    """Joint 3 has 0.8 of its gain and friction; both are written and drawn."""
    source, log, out = tmp_path / "arm.yaml", tmp_path / "log.parquet", tmp_path / "new.yaml"
    text = read_yaml(tl.model.sources.find_robot("sara").path)
    joints = [j | {"torque": "motor"} if j["torque"] == "sensor" else j for j in text["joints"]]
    source.write_text(yaml.safe_dump({**text, "model": "robot:sara", "joints": joints}))
    s = free_motion(tl.load_robot(source), 24.0, 100.0, seed=1, noise=0.02)
    s.tau[:, 2] = s.tau[:, 2] / 0.8 + 2.0 * np.tanh(s.qd[:, 2] / 0.05)
    write_table(log, s, robot.description)
    words = ["calibrate", str(log), "--robot", str(source), "--out", str(out), "--gains"]
    assert main([*words, "--pictures", str(tmp_path / "pictures")]) == 0
    told = capsys.readouterr().out
    assert "joint3: gain 0.80" in told and "times the described one" in told
    found = tl.load_robot(out).description.joints[2]
    assert found.gain == pytest.approx(0.8, rel=0.02)
    assert found.friction.coulomb == pytest.approx(2.0 * 0.8, rel=0.1)
    residuals, friction = (
        (tmp_path / "pictures" / f"{name}.svg").read_text() for name in ("residuals", "friction")
    )
    assert "axes_2" in residuals and "axes_1" in friction
    assert "friction.svg" in told


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--gains"], "no joint with torque: motor"),
        (["--pictures", "p", "--no-identify"], "leave --no-identify out"),
        (["--gains", "--no-identify"], "--gains"),
        (["--figure", "p.txt"], "--figure p.txt"),
    ],
)
def test_options_that_ask_for_nothing_are_told(logs, tmp_path, monkeypatch, capsys, options, words):
    monkeypatch.chdir(tmp_path)
    arguments = [str(logs[0]), "--robot", "sara", "--out", "a.yaml", *options]
    assert main(["calibrate", *arguments]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "a.yaml").exists()


def test_learning_needs_identification(tmp_path, capsys):
    log = tmp_path / "none.parquet"
    log.touch()
    arguments = ["--robot", "sara", "--out", str(tmp_path / "a.yaml"), "--learn", "--no-identify"]
    assert main(["calibrate", str(log), *arguments]) == 2
    assert "leave --no-identify out" in capsys.readouterr().err
    assert not (tmp_path / "a.yaml").exists()


def test_noise_is_measured_beneath_motion_and_jumps():
    rng = np.random.default_rng(0)
    t = np.arange(20_000) / 1000.0
    x = np.sin(5 * t) + 0.01 * rng.normal(size=len(t))
    x[5000:] += 3.0
    x[100] = np.nan
    meter = NoiseMeter(2)
    for part in np.array_split(np.column_stack([x, np.full(len(t), np.nan)]), 7):
        meter.add(part)
    assert meter.sigma()[0] == pytest.approx(0.01, rel=0.03)
    assert np.isnan(meter.sigma()[1])


def test_growth_is_found_again():
    rng = np.random.default_rng(1)
    activity = rng.uniform(0, 4, (200_000, 2))
    noise = np.full(len(activity), 0.2**2)
    sigma = np.sqrt(noise + 0.3**2 + (0.1 * activity[:, 0]) ** 2 + (0.05 * activity[:, 1]) ** 2)
    found = fit_growth(sigma * rng.normal(size=len(sigma)), noise, activity)
    assert found == pytest.approx((0.3, 0.1, 0.05), rel=0.1)


def test_a_touch_is_left_out_and_told(robot, maker, tmp_path, capsys):
    rng = generator(0)
    s = maker.samples(random_trajectory(robot, rng), rng)
    push = (s.time > 8.0) & (s.time < 8.5)
    s.wrench[push, 0, 1] -= 15.0  # the base sensor holds against it
    path = tmp_path / "touched.parquet"
    write_table(path, s, robot.description)
    more = tmp_path / "more.parquet"
    rng = generator(1)
    write_table(more, maker.samples(random_trajectory(robot, rng), rng), robot.description)
    out = tmp_path / "out.yaml"
    arguments = ["calibrate", str(more), str(path), "--robot", "sara", "--out", str(out)]
    assert main([*arguments, "--method", "cusum"]) == 0
    told = capsys.readouterr().out
    (stretch,) = re.findall(rf"{path}: from (\S+) to (\S+) s", told)
    assert 7.8 < float(stretch[0]) < 8.1 and 8.4 < float(stretch[1]) < 9.0
    assert main([*arguments, "--method", "cusum", "--trust", "--no-identify"]) == 0
    assert "left out" not in capsys.readouterr().out


def test_where_too_much_seems_touched_the_worst_row_is_named(robot, maker, tmp_path, monkeypatch):
    """Nothing may be left out: what seems to be touched is listed, with the row that stands out."""
    monkeypatch.setattr(run, "MOST_LEFT_OUT", 0.0)
    monkeypatch.setattr(run, "LISTED", 1)
    rng = generator(0)
    s = maker.samples(random_trajectory(robot, rng), rng)
    for begin in (5.0, 10.0, 15.0):
        pushed = (s.time > begin) & (s.time < begin + 0.05)
        s.wrench[pushed, 0, 1] -= 25.0
    path = tmp_path / "touched.parquet"
    write_table(path, s, robot.description)
    with pytest.raises(InputError) as caught:
        calibrate([path], "sara", tmp_path / "out.yaml", ("cusum",), identification=False)
    first, *_, last = lines = str(caught.value).splitlines()
    assert first.startswith(f"{path}: from ") and "touch segment base (" in first
    assert re.search(r"base\.fy is 2\d(\.\d)? N off, usually ", first)
    assert last.endswith("--trust takes them for its own doing")
    assert len(lines) == 3 and lines[1] == "... and 2 more"


@pytest.mark.parametrize(
    ("speed", "words"),
    [
        (None, "joint3 is 8 Nm off, usually 1.2 Nm"),
        ((-0.001, 0.001), "; the joint stands still"),
        ((-0.2, 0.3), "; the joint reverses (friction?)"),
        ((-0.25, -0.1), "; the joint moves at up to 0.25 rad/s"),
    ],
)
def test_a_row_is_blamed_with_what_its_joint_does(speed, words):
    assert str(Blame("joint3", "Nm", 8.0, 1.2, speed)).endswith(words)


def test_a_burst_in_one_joint_is_left_out(robot, maker, tmp_path):
    paths = []
    for i in range(2):
        rng = generator(i)
        s = maker.samples(random_trajectory(robot, rng), rng)
        if i == 1:  # stiction: a burst of torque where joint 3 reverses
            turns = np.flatnonzero((s.qd[:-1, 2] < 0) != (s.qd[1:, 2] < 0))
            quick = [k for k in turns if 4000 < k < 9000 and abs(s.qd[k - 50, 2]) > 0.03]
            s.tau[quick[0] - 30 : quick[0] + 30, 2] += 8.0
        paths.append(tmp_path / f"{i}.parquet")
        write_table(paths[-1], s, robot.description)
    left_out = calibrate(paths, "sara", tmp_path / "out.yaml", ("cusum",)).left_out
    assert left_out and {number for number, _, _ in left_out} == {1}
    assert sum(end - start for _, start, end in left_out) < 1.5


def test_a_test_that_could_not_be_set_is_refused(logs, tmp_path):
    tails = {"base": {"glrt": Tail(1.0, 60.0, 1.0, 0.0, 60, 1.0)}}
    robot = tl.load_robot("sara")
    with pytest.raises(InputError) as caught:
        _check_tails(robot, tails, ("glrt", "rows"), 0.02)
    words = str(caught.value)
    assert "72 s" in words and "rows (segment base)" in words and "glrt (segment wrist)" in words
    assert "--method glrt" in words


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: replace(s, tau=1e3 * s.tau), "every joint is about .* mNm"),
        (lambda s: replace(s, qd=np.degrees(s.qd)), "velocity of joint1"),
        (lambda s: replace(s, tau=-s.tau), "opposite sign"),
    ],
    ids=["torque unit", "velocity unit", "sign"],
)
def test_wrong_signals_are_refused(robot, tmp_path, change, words):
    log, out = tmp_path / "log.parquet", tmp_path / "out.yaml"
    write_table(log, change(free_motion(robot, 12.0, 100.0)), robot.description)
    with pytest.raises(InputError, match=words) as caught:
        calibrate([log], "sara", out)
    assert "nothing written: mend this first" in str(caught.value)
    assert not out.exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p: {"logs": []}, "at least one recording"),
        (lambda p: {"logs": [p[0], p[0]]}, "named twice"),
        (
            lambda p: {"logs": [p[0].with_name("short.parquet")], "identification": False},
            "20 s are",
        ),
        (lambda p: {"logs": [p[0].with_name("none.csv")]}, "no such file"),
        (lambda p: {"out": p[0].with_suffix(".txt")}, "ends in .yaml"),
        (lambda p: {"false_alarms": 0.0}, "--false-alarms 0"),
        (lambda p: {"robot": "sarah"}, "no robot of this name"),
    ],
)
def test_bad_input(logs, tmp_path, change, words):
    options = {"logs": logs, "robot": "sara", "out": tmp_path / "out.yaml"} | change(logs)
    with pytest.raises(InputError, match=words):
        calibrate(**options)
    assert not (tmp_path / "out.yaml").exists()


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("method: bayes", "detection.method: 'bayes' is not allowed"),
        ("method: [rows, rows]", "each once"),
        ("method: []", "at least one method"),
        ("false_alarms: 0", "detection.false_alarms: 0"),
        ("windows: [0.9]", "at most 0.5 s"),
        ("calibration: {hours: 1}", "detection.calibration"),
        (
            "calibration: {hours: 1, period: 0.001, rows: {base.fq: {typical: 1}}, tails: {}}",
            "base.fq",
        ),
        (
            "calibration: {hours: 1, period: 0.001, rows: {}, tails: {bas: {}}}",
            "detection.calibration.tails.bas",
        ),
    ],
)
def test_keys_are_checked(tmp_path, keys, words):
    path = tmp_path / "robot.yaml"
    sensors = "force_torque_sensors: [{name: base, link: link0}]\n"
    path.write_text(f"name: x\nmodel: robot:sara\n{sensors}detection:\n  {keys}\n")
    with pytest.raises(InputError, match=words.replace("[", r"\[")):
        tl.load_robot(path)


def standing(robot, seconds, seed):
    """One pose; 3 times as noisy as described."""
    rng = generator(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    q = np.full((len(time), len(robot.joint_names)), 0.4)
    tau, wrench = exact_loads(robot, time, q, 0.0 * q)
    noise = robot.description.noise
    tau = tau + 3.0 * np.array(noise.tau) * rng.normal(size=tau.shape)
    axes = np.array([noise.sensors[name] for name in robot.sensor_names])
    wrench = wrench + 3.0 * axes * rng.normal(size=wrench.shape)
    qd = np.array(noise.qd) * rng.normal(size=q.shape)
    return Samples(time, q, qd, tau, wrench)


def test_an_arm_that_stands_for_a_short_time_shows_its_noise_alone(robot, tmp_path, capsys):
    path, out = tmp_path / "standing.parquet", tmp_path / "out.yaml"
    write_table(path, standing(robot, 30.0, 0), robot.description)
    command = ["calibrate", str(path), "--robot", "sara", "--out", str(out)]
    assert main([*command, "--no-identify"]) == 0
    told = capsys.readouterr().out
    assert (
        "no joint moves by more than 0 rad" in told and "They follow from the noise figures" in told
    )
    again = tl.load_robot(out)
    assert again.description.detection.calibration is None
    np.testing.assert_allclose(
        again.description.noise.sensors["base"],
        3.0 * np.array(robot.description.noise.sensors["base"]),
        rtol=0.05,
    )
    assert main(command) == 2  # nothing can be identified in one pose
    assert "--no-identify" in capsys.readouterr().err


def test_what_stands_there_after_a_long_gap_is_an_offset(robot):
    """As dry friction leaves it after a touch that was left out."""
    s = standing(robot, 20.0, 1)
    after = s.time > 10.0
    s.wrench[after, 0, 2] += 3.0
    near = (s.time > 9.8) & (s.time < 10.3)
    whole, parted = (collect_residuals(robot, 1 / RATE, [[part]]) for part in (s, s.where(~near)))
    rows = make_thresholds(robot, 1 / RATE).rows
    fz = next(i for i, row in enumerate(rows) if row.component == 2)
    assert np.nanmax(np.abs(whole.residual[:, fz])) > 2.0
    assert np.nanmax(np.abs(parted.residual[:, fz])) < 1.0
