# SPDX-License-Identifier: Apache-2.0
"""The localization benchmark, small."""

import csv

import numpy as np
import pytest

import touchline as tl
from touchline.bench.localization import run_trials, table, write
from touchline.bench.touches import TouchSampler, touch_loads
from touchline.contact.skin import Skin


@pytest.fixture(scope="module")
def trials():
    return list(run_trials(tl.load_robot("sara"), (20.0,), 60, seed=4))


def test_touches_of_20_newton_are_found(trials):
    assert sum(trial.found for trial in trials) >= 59
    assert sum(trial.row_found for trial in trials) >= 58
    assert np.median([trial.error for trial in trials]) < 1e-3


def test_the_table_and_the_file_hold_every_trial(trials, tmp_path):
    lines = table(trials).splitlines()
    assert lines[-1].split()[:2] == ["all", "60"]
    bodies = {trial.body for trial in trials}
    assert bodies <= {line.split()[0] for line in lines if line}
    write(tmp_path / "trials.csv", trials)
    with (tmp_path / "trials.csv").open() as file:
        assert len(list(csv.DictReader(file))) == 60


def test_sampled_touches_can_be_reached():
    robot = tl.load_robot("sara")
    skin = Skin(robot)
    sampler = TouchSampler(skin, np.random.default_rng(3), clearance=0.03)
    for _ in range(30):
        touch = sampler.sample(20.0)
        assert np.linalg.norm(touch.force) == pytest.approx(20.0)
        assert -touch.normal @ touch.force / 20.0 >= 1 / np.sqrt(1.25) - 1e-9
        assert touch.position[2] >= 0.0
        assert skin.nearest(touch.q, touch.patch.link, touch.position)[0] < 1e-9
        for patch in skin.patches:
            if patch.link != touch.patch.link:
                outside = touch.position + 1e-6 * touch.normal
                assert patch.link not in skin.links_around(touch.q, outside)


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
