# SPDX-License-Identifier: Apache-2.0
"""Calibration on recordings of real robots: what is left over is friction, or a person."""

import os
from pathlib import Path

import numpy as np
import pytest

import touchline as tl
from touchline.calibrate.recordings import Recordings
from touchline.calibrate.run import calibrate
from touchline.calibrate.summary import summary_text
from touchline.detector.thresholds import make_thresholds
from touchline.errors import InputError
from touchline.identify.described import identified_robot
from touchline.identify.evidence import gather
from touchline.identify.identification import identify

REPOSITORY = Path(__file__).resolve().parents[2]
EXAMPLES = REPOSITORY / "examples" / "robots"
DATA = Path(os.environ.get("TOUCHLINE_DATA", REPOSITORY.parent / "shared" / "data"))


def real(*parts):
    path = DATA.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"no recordings at {DATA}: set TOUCHLINE_DATA")
    return path


TOUCHED = [("a4", "c5"), ("b6", "b8"), ("f2", "a6")]


@pytest.mark.parametrize("logs", TOUCHED)
def test_a_real_panda_in_one_pose_is_refused(logs, tmp_path):
    """An offset and a mass are the same there."""
    paths = [real("panda_touches", f"{log}.csv.gz") for log in logs]
    with pytest.raises(InputError, match=r"one pose.*\n.*some ten poses"):
        calibrate(paths, EXAMPLES / "panda_hand.yaml", tmp_path / "out.yaml")
    assert not (tmp_path / "out.yaml").exists()


@pytest.mark.parametrize("logs", TOUCHED)
def test_of_a_real_panda_that_is_touched_half_of_the_time_offsets_are_identified(logs):
    robot = tl.load_robot(EXAMPLES / "panda_hand.yaml")
    paths = [real("panda_touches", f"{log}.csv.gz") for log in logs]
    found = identify(gather(robot, Recordings(robot, paths).all("equations")))
    assert {column.kind for column in found.problem.columns} == {"bias"}
    assert found.problem.bodies == ()
    assert 0.4 < found.touched.mean() < 0.7  # labelled: 41 to 48 %, without the filter's tails
    assert (found.after <= 1.01 * found.before).all()
    biases = [joint.bias for joint in identified_robot(found).description.joints]
    assert np.abs(biases).max() < 1.5


@pytest.mark.parametrize("logs", TOUCHED)
def test_without_identification_such_recordings_are_refused(logs, tmp_path):
    paths = [real("panda_touches", f"{log}.csv.gz") for log in logs]
    with pytest.raises(InputError, match=r"panda_joint\d is more than .* % of the time"):
        calibrate(paths, EXAMPLES / "panda_hand.yaml", tmp_path / "out.yaml", identification=False)


def test_a_real_ur10_gets_thresholds_that_its_own_motion_keeps_below(tmp_path):
    log = real("panda_ur10_rosbag2", "ur10_exciting_trajectory.db3")
    text = (EXAMPLES / "ur10.yaml").read_text()
    robot = tmp_path / "ur10.yaml"
    robot.write_text("\n".join(x for x in text.splitlines() if not x.startswith("  contact:")))
    result = calibrate([log], robot, robot, identification=False)

    period = result.thresholds.description.period
    thresholds = make_thresholds(tl.load_robot(robot), period)
    assert thresholds.calibrated
    contact = np.array([row.contact for row in thresholds.rows])
    usual = np.array([row.typical for row in result.thresholds.description.rows.values()])
    assert (contact > 5 * usual).all() and (contact < 60).all()

    # Two thirds foresee what the last third does, within chance.
    telling = [h for h in result.thresholds.held_out if h.rate * h.hours > 3]
    assert {h.method for h in telling} == {"rows", "scaled", "chi2", "glrt", "cusum"}
    for h in telling:
        low, high = h.interval
        assert low < 1.5 * h.rate and high > h.rate / 1.5

    told = summary_text(result)
    assert "times what its noise explains" in told
    assert "extrapolated" in told and "too short to tell whether 1 an hour hold" in told
