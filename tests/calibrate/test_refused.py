# SPDX-License-Identifier: Apache-2.0
"""Recordings that nothing may be identified from: each is named, with what is wrong and to do."""

from dataclasses import replace

import numpy as np
import pytest
from free_motion import exact_loads, free_motion, pushed, smooth_motion

import touchline as tl
from touchline.calibrate.afterwards import (
    refuse_touched,
    refuse_two_robots,
    refuse_unexplained,
)
from touchline.cli.main import main
from touchline.errors import InputError
from touchline.identify.evidence import gather
from touchline.identify.identification import identify
from touchline.identify.touches import jumps
from touchline.logs import write_table
from touchline.observer.dynamics import gravity_loads
from touchline.trials.arms import described_arm
from touchline.trials.free_motion import random_trajectory
from touchline.trials.wrong_arm import make_wrong_arm, record

RATE, SECONDS = 100.0, 30.0
OLD = "name: old\n"
WEIGHT = [0.0, 0.0, -15.0]  # N


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara")


def nothing(values):
    return np.full(values.shape, np.nan)


VOID = {
    "positions": (lambda s: replace(s, q=nothing(s.q)), "no joint has a position", "q"),
    "stamps": (lambda s: replace(s, time=nothing(s.time)), "no time stamp", "time"),
    "readings": (
        lambda s: replace(s, tau=nothing(s.tau), wrench=nothing(s.wrench)),
        "no torque or force-torque reading",
        "tau, wrench",
    ),
}


@pytest.fixture(params=["calibrate", "check"])
def command(request, tmp_path):
    """Runs a command that would replace an older description; returns status and that file."""
    out = tmp_path / "out.yaml"
    out.write_text(OLD)

    def run(log):
        if request.param == "calibrate":
            return main(["calibrate", str(log), "--robot", "sara", "--out", str(out)])
        return main(["check", "sara", str(log), "--fix", str(out)])

    run.out = out
    return run


@pytest.mark.parametrize("kind", VOID)
def test_a_recording_without_any_value_is_refused(robot, command, tmp_path, capsys, kind):
    change, words, keys = VOID[kind]
    log = tmp_path / "void.parquet"
    write_table(log, change(free_motion(robot, 6.0, RATE)), robot.description)
    assert command(log) == 2
    told = capsys.readouterr().err
    assert f"{log}: {words}" in told and f"({keys})" in told
    assert command.out.read_text() == OLD


@pytest.mark.parametrize("rests", [False, True], ids=["moving", "at rest"])
def test_samples_that_are_no_numbers_are_counted_before_what_the_others_lack(
    robot, tmp_path, capsys, rests
):
    log = tmp_path / "ends.parquet"
    s = free_motion(robot, 20.0, RATE)
    if rests:
        s.q[:], s.qd[:] = s.q[0], 0.0
    s.q[300:-100] = np.nan
    write_table(log, s if rests else s.where(np.arange(len(s)) >= 200), robot.description)
    assert main(["calibrate", str(log), "--robot", "sara", "--out", str(tmp_path / "o.yaml")]) == 2
    first, second, *_ = capsys.readouterr().err.splitlines()
    count = 2000 if rests else 1800
    assert first.startswith(
        f"touchline: {log}: 1600 of {count} samples have a position or velocity"
    )
    assert ("one pose alone" if rests else "2 s of contact-free data") in second


@pytest.mark.parametrize(("signal", "every"), [("q", False), ("qd", False), ("qd", True)])
def test_the_joint_whose_motion_is_no_number_is_named(robot, tmp_path, capsys, signal, every):
    log, out = tmp_path / "void.parquet", tmp_path / "o.yaml"
    s, name = free_motion(robot, 6.0, RATE), robot.joint_names[1]
    getattr(s, signal)[:, slice(None) if every else 1] = np.nan
    write_table(log, s, robot.description)
    assert main(["calibrate", str(log), "--robot", "sara", "--out", str(out)]) == 2
    told = capsys.readouterr().err
    what = {"q": "position", "qd": "velocity"}[signal]
    whose = f"all {len(robot.joint_names)} joints" if every else f"{name} (column {signal}.{name}"
    assert "600 of 600 samples have a position or velocity that is not a number" in told
    assert f"{what} of {whose}" in told and f"columns under `log: {signal}`" in told
    assert not out.exists()


def test_a_velocity_column_that_is_taken_out_is_estimated(robot, tmp_path):
    log, out = tmp_path / "less.csv", tmp_path / "o.yaml"
    s = free_motion(robot, 16.0, RATE)
    s.tau[:, 2] += 1.0  # an offset to be found
    write_table(log, s, robot.description)
    rows = [line.split(",") for line in log.read_text().splitlines()]
    at = rows[0].index(f"qd.{robot.joint_names[1]}")
    log.write_text("".join(",".join(r[:at] + r[at + 1 :]) + "\n" for r in rows))
    assert main(["calibrate", str(log), "--robot", "sara", "--out", str(out)]) == 0


def test_a_joint_whose_torque_is_no_number_is_told_to_be_not_calibrated(robot, tmp_path, capsys):
    log, out = tmp_path / "void.parquet", tmp_path / "o.yaml"
    s, name = free_motion(robot, 16.0, RATE), robot.joint_names[1]
    s.tau[:, 1] = np.nan
    s.tau[:, 2] += 1.0  # an offset to be found
    write_table(log, s, robot.description)
    assert main(["calibrate", str(log), "--robot", "sara", "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert f"torque of {name} (column tau.{name} of `log: tau`) is not a number" in told
    assert "in 1600 of 1600 samples: not calibrated; record it" in told
    tl.load_robot(out)


def test_a_single_sample_is_refused(robot, command, tmp_path, capsys):
    log = tmp_path / "one.parquet"
    s = free_motion(robot, 1.0, RATE)
    write_table(log, s.where(np.arange(len(s)) < 1), robot.description)
    assert command(log) == 2
    assert f"{log}: holds 1 sample, 10 at least" in capsys.readouterr().err
    assert command.out.read_text() == OLD


def backwards(time):
    return time[::-1].copy()


@pytest.mark.parametrize("change", [np.zeros_like, backwards], ids=["repeated", "going back"])
def test_stamps_that_do_not_rise_are_counted_with_the_first_row(robot, tmp_path, capsys, change):
    log = tmp_path / "clock.parquet"
    s = free_motion(robot, 20.0, RATE)
    write_table(log, replace(s, time=change(s.time)), robot.description)
    out = tmp_path / "o.yaml"
    assert main(["calibrate", str(log), "--robot", "sara", "--out", str(out)]) == 2
    told = capsys.readouterr().err
    assert f"{log}: 1999 of 2000 time stamps are not later than all before" in told
    assert "the first in row 1:" in told and "log: time" in told and not out.exists()


def test_a_clock_that_was_set_back_is_told_beside_the_result(robot, tmp_path, capsys):
    log = tmp_path / "clock.csv"
    s = free_motion(robot, 16.0, RATE)
    s.tau[:, 2] += 1.0  # an offset to be found
    s.time[1100:] -= 10.0
    write_table(log, s, robot.description)
    arguments = ["calibrate", str(log), "--robot", "sara", "--out", str(tmp_path / "o.yaml")]
    assert main(arguments) == 0
    told = capsys.readouterr().out
    assert "500 of 1600 time stamps are not later than all before them, the first in" in told
    assert "row 1100: they are left out" in told


def test_a_recording_that_is_cut_off_is_said_to_be(robot, tmp_path, capsys):
    log = tmp_path / "cut.csv"
    write_table(log, free_motion(robot, 3.0, RATE), robot.description)
    text = log.read_text()
    log.write_text(text[: len(text) // 2])
    main(["check", "sara", str(log)])
    assert "the last line (after row 150) is incomplete" in capsys.readouterr().out


def test_a_recording_cut_off_is_said_to_be_by_calibrate(robot, tmp_path, capsys):
    log = tmp_path / "cut.csv"
    s = free_motion(robot, 16.0, RATE)
    s.tau[:, 2] += 1.0  # an offset to be found
    write_table(log, s, robot.description)
    text = log.read_text()
    log.write_text(text[: len(text) // 2])
    assert main(["calibrate", str(log), "--robot", "sara", "--out", str(tmp_path / "o.yaml")]) == 0
    assert "incomplete and is left out" in capsys.readouterr().out


def test_where_nothing_can_be_written_is_told_before_the_work(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    place = tmp_path / "file"
    fix = ["--fix", str(place / "o.yaml")]
    assert main(["check", "sara", "none.parquet", *fix]) == 2
    assert "--fix" in capsys.readouterr().err
    assert main(["check", "sara", "--fix", str(tmp_path / "o.txt")]) == 2
    assert "ends in .yaml" in capsys.readouterr().err
    calibrate = ["calibrate", "none.parquet", "--robot", "sara", "--out", str(tmp_path / "a.yaml")]
    assert main([*calibrate, "--pictures", str(place)]) == 2
    assert str(place) in capsys.readouterr().err
    assert main([*calibrate, "--figure", str(place / "f.svg")]) == 2
    assert "--figure" in capsys.readouterr().err


def test_a_plan_reads_no_recording(tmp_path, capsys):
    out = tmp_path / "motion"
    arguments = ["calibrate", "run.parquet", "--plan", "sara", "--learn", "--out", str(out)]
    assert main(arguments) == 2
    assert "leave LOG, --learn out" in capsys.readouterr().err
    assert not out.exists()


def touched(robot, share, seed=0):
    """Motion in which forces of 5 to 25 N touch one of the last links for a share of the time."""
    s, rng = free_motion(robot, SECONDS, RATE, noise=0.05), np.random.default_rng(seed)
    links = [node.links[0] for node in robot.nodes if node.links][-3:]
    at = 0.0
    while at < SECONDS:
        at += 1.5 * (1.0 / share - 1.0) * rng.uniform(0.5, 1.5)
        end = at + rng.uniform(0.5, 2.5)
        rows = np.flatnonzero((s.time >= at) & (s.time < end))
        way = rng.normal(size=3)
        if len(rows):
            force = way / np.linalg.norm(way) * rng.uniform(5.0, 25.0)
            s = pushed(robot, s, str(rng.choice(links)), rows, force)
        at = end
    return s


@pytest.mark.parametrize("share", [0.75, 0.9])
def test_a_robot_that_is_touched_most_of_the_time_is_refused(robot, share):
    """What is touched counts as usual then, and little of it stands out."""
    evidence = gather(robot, [[touched(robot, share)]])
    with pytest.raises(InputError, match=r"seems to touch the robot (most|for \d+ %) of the time"):
        refuse_touched(identify(evidence), [])


def test_a_third_of_touches_does_no_harm(robot):
    found = identify(gather(robot, [[touched(robot, 0.33)]]))
    assert 0.2 < found.touched.mean() < 0.6
    refuse_touched(found, [])
    free = gather(robot, [[free_motion(robot, SECONDS, RATE, seed=5, noise=0.05)]])
    assert np.sqrt(np.mean(found.left(free) ** 2, axis=0)).max() < 0.05


def test_noise_does_not_jump_and_touches_do(robot):
    evidence = gather(robot, [[free_motion(robot, SECONDS, RATE, noise=0.05)]])
    rng = np.random.default_rng(0)
    left = rng.normal(size=evidence.reading.shape)
    every = np.ones(len(evidence), dtype=bool)
    assert jumps(evidence, left, every)[1] == pytest.approx(1.645 / 0.6745, rel=0.1)
    left[:, 3] += 50.0 * (evidence.time % 2.0 < 1.0)
    row, size = jumps(evidence, left, every)
    assert row == 3 and size > 13.0
    assert jumps(evidence, left, evidence.time % 2.0 < 0.9)[1] < 5.0  # changes across are no part


def test_the_log_of_another_robot_is_refused(robot, tmp_path):
    s = free_motion(robot, SECONDS, RATE)
    q, qd = smooth_motion(robot, SECONDS, RATE, seed=7)
    tau, wrench = exact_loads(robot, s.time, q, qd)
    found = identify(gather(robot, [[replace(s, tau=tau, wrench=wrench)]]))
    with pytest.raises(InputError, match=r"a\.parquet: does not fit sara: .*whatever"):
        refuse_unexplained(found, [tmp_path / "a.parquet"])


@pytest.fixture(scope="module")
def panda():
    """Recordings of an arm with torques alone, which has an unknown payload and friction."""
    robot, rng = described_arm("panda-torques"), np.random.default_rng(1)
    arm = make_wrong_arm(robot, "friction", rng)
    return robot, record(arm, random_trajectory(robot, rng), 30.0, RATE, rng)


def test_a_robot_whose_weight_an_offset_would_take_is_refused(panda, tmp_path):
    robot, s = panda
    other, rng = tl.load_robot("sara"), np.random.default_rng(3)
    arm = make_wrong_arm(other, "payload alone", rng)
    own = record(arm, random_trajectory(other, rng), 30.0, RATE, rng)
    n = own.q.shape[1]
    filled = [np.zeros_like(s.q), np.zeros_like(s.q), s.tau.copy()]
    for values, theirs in zip(filled, (own.q, own.qd, own.tau), strict=True):
        values[:, :n] = theirs
    q, qd, tau = filled
    found = identify(gather(robot, [[replace(s, q=q, qd=qd, tau=tau)]]))
    with pytest.raises(InputError, match=r"a\.parquet: does not fit panda-torques: .*check ROBOT"):
        refuse_unexplained(found, [tmp_path / "a.parquet"])


def test_an_offset_beyond_all_torques_of_the_arm_is_refused(panda, tmp_path):
    robot, s = panda
    refuse_unexplained(identify(gather(robot, [[s]])), [])
    tau = s.tau.copy()
    tau[:, 1] += 150.0  # Nm; the arm's own weight makes 60 Nm at most
    found = identify(gather(robot, [[replace(s, tau=tau)]]))
    with pytest.raises(InputError, match=r"panda_joint2 would have an offset of \+150 Nm, where"):
        refuse_unexplained(found, [tmp_path / "a.parquet"])


NOT_READ = {
    "nothing": (lambda robot, s: np.zeros_like(s.tau), "is always 0: dead"),
    "gravity taken out": (
        lambda robot, s: s.tau - gravity_loads(robot, s.q).torque,
        "times what the model expects",
    ),
    "external torques": (
        lambda robot, s: np.random.default_rng(0).normal(0.0, 0.05, s.tau.shape),
        "gravity seems taken out already",
    ),
}


@pytest.mark.parametrize("kind", NOT_READ)
def test_what_does_not_fit_is_told_with_the_cause_that_check_finds(panda, tmp_path, capsys, kind):
    robot, s = panda
    change, words = NOT_READ[kind]
    log, out = tmp_path / "other.parquet", tmp_path / "o.yaml"
    write_table(log, replace(s, tau=change(robot, s)), robot.description)
    described = str(robot.description.path)
    assert main(["calibrate", str(log), "--robot", described, "--out", str(out)]) == 2
    first, *more = capsys.readouterr().err.splitlines()
    assert f"{log}: does not fit panda-torques" in first and "touchline check ROBOT LOG" in first
    assert any(words in line for line in more), more
    assert not out.exists()


def test_recordings_of_robots_that_carry_different_weights_are_refused(robot, tmp_path):
    one, other = (free_motion(robot, 20.0, RATE, seed=k) for k in (1, 2))
    logs = [tmp_path / "a.parquet", tmp_path / "b.parquet"]
    refuse_two_robots(identify(gather(robot, [[one], [other]])), logs)
    heavy = pushed(robot, other, "tool", slice(None), WEIGHT)
    found = identify(gather(robot, [[one], [heavy]]))
    with pytest.raises(InputError, match=r"one robot: in \w+\.f. of .*a\.parquet a fit to all"):
        refuse_two_robots(found, logs)
    most = replace(found, touched=found.evidence.recording == 1)
    with pytest.raises(InputError, match=r"one robot: nothing in .*b\.parquet is as in the others"):
        refuse_two_robots(most, logs)


def test_recordings_of_robots_that_differ_in_many_ways_are_refused(robot, tmp_path):
    recordings = []
    for seed in (1, 2):
        rng = np.random.default_rng(seed)
        arm = make_wrong_arm(robot, "friction", rng)
        recordings.append([record(arm, random_trajectory(robot, rng), 30.0, RATE, rng)])
    found = identify(gather(robot, recordings))
    with pytest.raises(InputError, match=r"a fit to all leaves \d+ times what one"):
        refuse_two_robots(found, [tmp_path / "a.parquet", tmp_path / "b.parquet"])
