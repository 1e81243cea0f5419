# SPDX-License-Identifier: Apache-2.0
"""A moment that alone sets a threshold of `calibrate` is told; ordinary tails have none."""

import numpy as np
import pytest

import touchline as tl
from touchline.calibrate.one_moment import find_moments
from touchline.cli.main import main
from touchline.detector.calibration import BLOCK, Statistics
from touchline.detector.tail import fit_tail
from touchline.logs import write_table
from touchline.model.values import METHODS
from touchline.trials.free_motion import MotionMaker, generator, imperfect, random_trajectory


def statistics(series):
    blocks = np.full((len(series), 1, len(METHODS)), np.nan)
    blocks[:, 0, 0] = series
    time = BLOCK * np.arange(len(series))
    return Statistics(blocks, time, np.zeros(len(series), int), time[-1] / 3600)


def found_in(series):
    all_ = statistics(series)
    tails = {"root": {METHODS[0]: fit_tail(series, all_.hours, all_.gap)}}
    return find_moments(all_, ["root"], tails, METHODS[:1], 1.0)


def test_a_minute_of_ordinary_excursions_has_no_such_moment():
    rng = np.random.default_rng(3)
    told = [bool(found_in(rng.exponential(size=3000))) for _ in range(40)]
    assert sum(told) <= 2


def test_a_burst_is_told_with_its_time_and_the_threshold_without_it():
    rng = np.random.default_rng(4)
    series = rng.exponential(size=3000)
    usual = fit_tail(series, 1 / 60, 10)
    series[1500:1504] = 30.0, 60.0, 40.0, 20.0
    (moment,) = found_in(series)
    assert moment.time == pytest.approx(1501 * BLOCK)
    assert moment.without == pytest.approx(usual.threshold(1.0), rel=0.1)
    assert moment.threshold > 1.5 * moment.without


def test_a_hard_stop_is_told_by_calibrate(tmp_path, capsys):
    robot = tl.load_robot("sara")
    paths = []
    for i in range(2):
        rng = generator(i)
        s = MotionMaker(robot, imperfect(robot, 0.02, 1), 200.0, 20.0).samples(
            random_trajectory(robot, rng), rng
        )
        if i == 1:  # for 30 ms every joint brakes by more than was sampled
            s.tau[2000:2006] += 4.0
        paths.append(str(tmp_path / f"{i}.parquet"))
        write_table(tmp_path / f"{i}.parquet", s, robot.description)
    command = ["--robot", "sara", "--out", str(tmp_path / "out.yaml"), "--no-identify", "--trust"]
    assert main(["calibrate", *paths, *command]) == 0
    told = capsys.readouterr().out
    assert f"one moment sets rows of base: {paths[1]} at 10.0" in told
    assert "cut it out" in told
