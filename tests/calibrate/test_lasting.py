# SPDX-License-Identifier: Apache-2.0
"""What touches the arm throughout a recording: refused where it shows, else told to be possible."""

from dataclasses import replace

import numpy as np
import pytest
from free_motion import pushed

from touchline.calibrate.afterwards import refuse_resting
from touchline.calibrate.lasting import lasting_lines
from touchline.calibrate.resting import find_changing, find_resting
from touchline.cli.main import main
from touchline.errors import InputError
from touchline.identify.evidence import gather
from touchline.identify.identification import identify
from touchline.logs import write_table
from touchline.model.robot import Robot
from touchline.model.transforms import rotation_about
from touchline.observer.dynamics import contact_loads
from touchline.trials.arms import described_arm
from touchline.trials.free_motion import random_trajectory
from touchline.trials.wrong_arm import make_wrong_arm, record

HAND = np.array([8.0, -8.0, 4.0])  # N in world: 12 N
LEANING = 3.0  # degrees


def moving(robot, seed, leaning=0.0):
    """Samples of an arm that is not as described, nothing touching it; its base may lean."""
    rng = np.random.default_rng(seed)
    arm = make_wrong_arm(robot, "friction", rng)
    turned = rotation_about(np.array([0.6, 0.8, 0.0]), np.radians(leaning))
    mechanism = replace(arm.real.mechanism, gravity=turned @ arm.real.gravity)
    arm = replace(arm, real=Robot(arm.real.description, mechanism))
    return record(arm, random_trajectory(robot, rng), 30.0, 100.0, rng)


def last_links(robot):
    return [node.links[0] for node in robot.nodes if node.links][-3:]


def found_in(robot, samples):
    return identify(gather(robot, [[samples]]))


@pytest.mark.parametrize("seed", [1, 2])
def test_a_hand_that_rests_on_the_arm_throughout_is_thought_of(seed):
    robot = described_arm("panda-torques")
    free = moving(robot, seed)
    assert lasting_lines(found_in(robot, free)) == []
    link = last_links(robot)[-1]
    weight = pushed(robot, free, link, slice(None), [0.0, 0.0, -15.0])
    (line,) = lasting_lines(found_in(robot, weight))
    assert "panda_joint" in line and "a touch or a load" in line and "look the same" in line


@pytest.mark.parametrize(("arm", "which"), [("panda-torques", -1), ("ur10", -3)])
def test_a_hand_that_pushes_throughout_is_refused_with_its_size_and_link(arm, which, tmp_path):
    robot = described_arm(arm)
    free = moving(robot, 5)
    refuse_resting(found_in(robot, free), [])
    link = last_links(robot)[which]
    found = found_in(robot, pushed(robot, free, link, slice(None), HAND))
    force = find_resting(found)
    assert force.frame == "" and force.explained > 0.6
    # A payload takes a part of what is vertical; the rest is told.
    np.testing.assert_allclose(force.force[:2], HAND[:2], atol=2.0)
    told = rf"a\.parquet: something seems to rest.* N at {force.link}, constant in the world, expl"
    with pytest.raises(InputError, match=told):
        refuse_resting(found, [tmp_path / "a.parquet"])


def test_a_cable_that_pulls_along_a_link_is_refused():
    robot = described_arm("panda-torques")
    free, link = moving(robot, 6), last_links(robot)[0]
    along = np.array([robot.T_world_links(q)[link][:3, :3] @ [0.0, 9.0, 9.0] for q in free.q])
    places = np.array([robot.T_world_links(q)[link][:3, 3] for q in free.q])
    loads = contact_loads(robot, free.q, link, np.hstack([along, np.cross(places, along)]))
    found = found_in(robot, replace(free, tau=free.tau - loads.torque))
    with pytest.raises(InputError, match=r"13 N at \w+, constant in the frame of"):
        refuse_resting(found, [])


@pytest.mark.parametrize("arm", ["panda-torques", "ur10"])
def test_a_base_that_leans_is_no_hand(arm):
    robot = described_arm(arm)
    refuse_resting(found_in(robot, moving(robot, 7, LEANING)), [])


@pytest.mark.parametrize(("share", "refused"), [(0.35, False), (0.8, True), (1.0, True)])
def test_touches_of_some_seconds_most_of_the_time_are_refused(share, refused):
    """Few of them begin or end, so that little jumps."""
    robot, rng = described_arm("panda-torques"), np.random.default_rng(3)
    s, at = moving(robot, 9), 0.0
    while at < s.time[-1]:
        at += 6.0 * (1.0 / share - 1.0) * rng.uniform(0.5, 1.5)
        end = at + 6.0 * rng.uniform(0.5, 1.5)
        way, rows = rng.normal(size=3), np.flatnonzero((s.time >= at) & (s.time < end))
        if len(rows):
            force = way / np.linalg.norm(way) * rng.uniform(10.0, 25.0)
            s = pushed(robot, s, str(rng.choice(last_links(robot))), rows, force)
        at = end
    found = found_in(robot, s)
    changing = find_changing(found)
    assert changing.there == refused
    if refused:
        with pytest.raises(InputError, match=r"most of the time: forces of about [\d.]+ N, one"):
            refuse_resting(found, [])
    else:
        refuse_resting(found, [])


def test_nothing_is_written_unless_the_recording_is_trusted(tmp_path, capsys):
    robot = described_arm("panda-torques")
    log, out = tmp_path / "held.parquet", tmp_path / "o.yaml"
    held = pushed(robot, moving(robot, 8), last_links(robot)[-1], slice(None), HAND)
    write_table(log, held, robot.description)
    arguments = ["calibrate", str(log), "--robot", str(robot.description.path), "--out", str(out)]
    assert main(arguments) == 2
    told = capsys.readouterr().err
    assert "rest on the arm throughout" in told and "nothing touches the arm" in told
    assert not out.exists()
    assert main([*arguments, "--trust"]) == 0
    assert out.exists()
