# SPDX-License-Identifier: Apache-2.0
"""Figure 4: the methods against each other and against the truth, and what the command writes."""

import csv
import re

import numpy as np
import pytest

from touchline.cli import main
from touchline.model.robot import load_robot
from touchline.observer.classical import classical_error
from touchline.reproduce import fig4
from touchline.reproduce.conditioning import EndEffector, best_conditioned, nearby_singularity
from touchline.reproduce.passage import passage
from touchline.simulation.setup import read_setup

ACROSS = (5.5, 6.5)  # the second in which the arm crosses the singularity


@pytest.fixture(scope="module")
def way():
    return passage(0, ACROSS)


@pytest.fixture(scope="module")
def outcome(way):
    return fig4.disturbed(way, 1.0, 50.0)


def test_the_arm_passes_the_best_configuration_and_crosses_the_singularity(way):
    setup = read_setup(way.robot)
    effector = EndEffector(way.robot, "tool")
    others = np.random.default_rng(9).uniform(setup.lower, setup.upper, (2000, 7))
    assert effector.condition(way.best) < effector.condition(others).min()
    middle = len(way.motion.time) // 2
    np.testing.assert_allclose(way.motion.q[middle], way.singular, atol=1e-12)
    assert way.condition[middle] > 1e9 and np.median(way.condition) < 1e3
    whole = passage(0, (2.0, 2.01))
    np.testing.assert_allclose(whole.motion.q[0], whole.best, atol=1e-12)
    smallest = np.linalg.svd(effector.jacobian(way.motion.q), compute_uv=False)[:, -1]
    assert smallest[middle - 100] > 0.01 < smallest[middle + 100]


def test_the_arm_keeps_to_its_limits():
    way = passage(0, fig4.SPAN)
    joints = [way.robot.mechanism.joints[name] for name in way.robot.joint_names]
    assert (way.motion.q > [j.lower for j in joints]).all()
    assert (way.motion.q < [j.upper for j in joints]).all()
    assert (np.abs(way.motion.qd).max(axis=0) < [j.velocity for j in joints]).all()
    assert way.condition.min() == pytest.approx(EndEffector(way.robot, "tool").condition(way.best))


def test_the_classical_error_is_its_closed_form(way, outcome):
    assert outcome.closed_form_difference < 1e-8
    lag = outcome.residuals["classical"].copy()
    lag[:, fig4.JOINT] -= outcome.disturbance
    ours = classical_error(way.robot, way.motion.q, lag, np.zeros_like(lag))
    np.testing.assert_allclose(ours, outcome.wrenches["closed_form"], atol=1e-9)
    assert outcome.largest("classical", 0)[0] > 2.0


@pytest.mark.parametrize("method", ["paper", "segment"])
def test_the_extended_observer_reports_no_force(outcome, method):
    for sensor in range(3):
        force, moment = outcome.largest(method, sensor)
        assert 0 < force < 1e-3 and 0 < moment < 1e-3


def test_all_methods_have_the_same_joint_residuals(outcome):
    assert outcome.residual_difference < 1e-9
    assert np.abs(outcome.residuals["segment"][:, fig4.JOINT]).max() > 9.0


def test_the_disturbance_is_not_in_the_joint_sensor(way, outcome):
    """Were it there, the residual would be zero and nothing would be wrong anywhere."""
    lagging = np.abs(outcome.residuals["segment"][:, fig4.JOINT] - outcome.disturbance)
    assert 0.5 < lagging[200:].max() < 2.0


def test_a_singularity_is_found_from_anywhere():
    robot = load_robot("sara-full")
    effector = EndEffector(robot, "tool")
    for start in np.random.default_rng(1).uniform(-1.0, 1.0, (3, 7)):
        sigma = np.linalg.svd(effector.jacobian(nearby_singularity(effector, start)))[1]
        assert sigma[-1] < 1e-12 * sigma[0]


def test_the_best_configuration_does_not_depend_on_the_seed():
    robot = load_robot("sara-full")
    setup, effector = read_setup(robot), EndEffector(robot, "tool")
    values = [
        float(effector.condition(best_conditioned(effector, setup.lower, setup.upper, seed)))
        for seed in (3, 4)
    ]
    assert values[0] == pytest.approx(values[1], rel=1e-5)


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(fig4, "SPAN", ACROSS)
    monkeypatch.setattr(fig4, "FREQUENCIES", (1.0,))
    monkeypatch.setattr(fig4, "BANDWIDTHS", (50.0,))


def test_the_command_writes_figures_numbers_and_a_page(short, tmp_path, capsys):
    assert main(["reproduce", "fig4", "--out", str(tmp_path / "new" / "out")]) == 0
    out = tmp_path / "new" / "out"
    assert "holds" in capsys.readouterr().out
    for kind in ("pdf", "svg", "png"):
        assert (out / "fig4" / f"fig4.{kind}").stat().st_size > 10_000
    with (out / "fig4" / "table.csv").open() as file:
        table = list(csv.DictReader(file))
    columns = ["method", "frequency", "bandwidth", "sensor", "force_max", "moment_max"]
    assert list(table[0]) == columns
    force = {(r["method"], r["sensor"]): float(r["force_max"]) for r in table}
    assert force["classical", "base"] > 1.0 > 1e-3 > force["segment", "base"]
    page = (out / "index.html").read_text()
    assert page.count("data:image/svg+xml") == 2 and "What the paper says" in page
    sources = re.findall(r'(?:src|href)="([^"]{0,8})', page)
    assert sources and all(source.startswith("data:") for source in sources)


def test_the_same_seed_gives_the_same_numbers(short):
    one, other = (fig4.run(5, lambda name: None, lambda shown, table: {}) for _ in range(2))
    assert one.tables == other.tables and one.checks == other.checks
    for name, column in one.series["series"].items():
        np.testing.assert_array_equal(column, other.series["series"][name])


def test_bad_input_is_told(tmp_path, capsys):
    assert main(["reproduce", "fig9", "--out", str(tmp_path)]) == 2
    file = tmp_path / "file"
    file.write_text("")
    assert main(["reproduce", "fig4", "--out", str(file / "x")]) == 2
    assert "cannot be used as a directory" in capsys.readouterr().err
