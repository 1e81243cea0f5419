# SPDX-License-Identifier: Apache-2.0
"""What a joint's torque has beside the model is learned, and told from noise."""

from dataclasses import replace
from functools import cache

import numpy as np
from free_motion import free_motion
from robots import random_robot

from touchline.identify.choice import regions_of
from touchline.identify.evidence import filtered, gather
from touchline.identify.identification import identify, rms
from touchline.identify.rest import grids_of, inner, learn, with_rest
from touchline.model.robot import Robot

RIPPLE, TEETH = 0.6, 4.0  # Nm, rad/rad


def arm():
    robot = random_robot(0, sensors=1, chain=True, bandwidth=20.0, movable=5)
    return Robot(replace(robot.description, sensors=()), robot.mechanism)


def rippled(robot, seed):
    """A motion whose second joint has a torque that depends on its place."""
    s = free_motion(robot, 40.0, 100.0, seed=seed, noise=0.02)
    s.tau[:, 1] += RIPPLE * np.sin(TEETH * s.q[:, 1])
    return s


@cache
def learned_ripple():
    return learned(arm(), rippled(arm(), 1))


def learned(robot, samples):
    evidence = gather(robot, [[samples]])
    found, grids = identify(evidence), grids_of(evidence)
    return found, grids, learn(found, grids, filtered(robot, [[samples]], grids.hats))


def test_a_ripple_is_learned_where_it_is_and_nowhere_else():
    robot = arm()
    _, _, rest = learned_ripple()
    others = [t.largest for name, t in rest.tables.items() if name != robot.joint_names[1]]
    assert max(others, default=0.0) < 0.05 * RIPPLE
    assert rest.after[1] < 0.5 * rest.before[1]
    table = rest.tables[robot.joint_names[1]]
    assert table.largest < 2.0 * RIPPLE
    assert max(table.doubt) < RIPPLE
    q, qd = table.q[len(table.q) // 2], 0.0
    far = np.array([table.q[0] - 0.1, table.q[-1] + 0.1, q, q])
    fast = np.array([qd, qd, table.qd[0] - 0.1, table.qd[-1] + 0.1])
    assert not table.at(far, fast).any()


def test_it_foretells_a_motion_that_it_has_not_seen():
    robot = arm()
    _, _, rest = learned_ripple()
    other = rippled(robot, 2)
    name = robot.joint_names[1]
    plain = gather(robot, [[other]]).residual()[:, 1]
    better = gather(with_rest(robot, rest.tables), [[other]]).residual()[:, 1]
    assert name in rest.tables
    assert rms((better - better.mean())[:, None]) < 0.5 * rms((plain - plain.mean())[:, None])


def test_the_filtered_hats_are_what_the_table_does():
    robot = arm()
    s = rippled(robot, 1)
    _, grids, rest = learned_ripple()
    columns = filtered(robot, [[s]], grids.hats)
    table = rest.tables[robot.joint_names[1]]
    plain = gather(robot, [[s]]).residual()
    better = gather(with_rest(robot, rest.tables), [[s]]).residual()
    added = columns[:, grids.columns(1)] @ inner(table)
    np.testing.assert_allclose((better - plain)[:, 1], added, atol=1e-5)


def test_noise_is_not_learned():
    robot = arm()
    _, _, rest = learned(robot, free_motion(robot, 40.0, 100.0, seed=3, noise=0.1))
    assert not rest.tables


def test_nothing_is_learned_that_harms_a_part_of_the_workspace():
    """Over the whole, a table of the ripple helps; in a quarter of it the ripple is another one."""
    robot = arm()
    s = free_motion(robot, 40.0, 100.0, seed=1, noise=0.02)
    centred = s.q - s.q.mean(axis=0)
    along = centred @ np.linalg.svd(centred, full_matrices=False)[2][0]
    size = np.where(along > np.quantile(along, 0.75), -0.5 * RIPPLE, RIPPLE)
    s.tau[:, 1] += size * np.sin(TEETH * s.q[:, 1])
    _, _, rest = learned(robot, s)
    assert robot.joint_names[1] not in rest.tables


def test_regions_hold_every_instant_once_along_each_direction():
    robot = arm()
    evidence = gather(robot, [[rippled(robot, 1)]])
    use = np.ones(len(evidence), dtype=bool)
    folds = list(regions_of(evidence, use))
    assert len(folds) == 8
    assert (np.sum([fold.test for fold in folds[:4]], axis=0) == 1).all()
    assert all(not (fold.test & fold.train).any() for fold in folds)
