# SPDX-License-Identifier: Apache-2.0
"""A grasped body is weighed in free motion: what is no load alone is told beside its mass."""

from dataclasses import replace

import numpy as np
import pytest
from free_motion import free_motion, pushed

import touchline as tl
from touchline.errors import InputError
from touchline.identify.payload import weigh_load
from touchline.model.corrections import with_loads
from touchline.model.description import Load
from touchline.model.perturbed import perturbed
from touchline.model.robot import Robot

LINK, MASS, SECONDS = "tool", 0.8, 5.0  # kg, s
HALF = slice(500, None)


def motion(links_off, held=MASS):
    """Of an arm whose links are off by that part, with a ball in the gripper."""
    robot = tl.load_robot("sara")
    wrong = perturbed(robot.mechanism, links_off, np.random.default_rng(5))
    inertia = tuple(1e-3 * held * (i in (0, 3, 5)) for i in range(6))
    loads = (Load(LINK, held, (0.0, 0.0, 0.05), inertia),) if held else ()
    arm = Robot(*with_loads(wrong, robot.description, loads))
    return robot, free_motion(arm, SECONDS, noise=0.05)


@pytest.mark.parametrize("links_off", [0.0, 0.015, 0.03])
def test_of_a_load_alone_nothing_is_doubted(links_off):
    robot, free = motion(links_off)
    found = weigh_load(robot, [free], LINK)
    assert found.doubt == "" and found.mass == pytest.approx(MASS, abs=4.0 * found.mass_error)


def hand(robot, free):
    return pushed(robot, free, LINK, slice(None), [0.0, 0.0, -15.0])


def passing_hand(robot, free):
    return pushed(robot, free, LINK, slice(500, 700), [0.0, 0.0, -15.0])


def offset(robot, free):
    moved = replace(free, tau=free.tau.copy(), wrench=free.wrench.copy())
    moved.tau[:, 1] += 5.0
    moved.wrench[:, 0, 2] += 10.0
    return moved


def late_grasp(robot, free):
    _, empty = motion(0.0, held=0.0)
    late = replace(free, tau=free.tau.copy(), wrench=free.wrench.copy())
    late.tau[:500], late.wrench[:500] = empty.tau[:500], empty.wrench[:500]
    return late


@pytest.mark.parametrize("spoilt", [hand, passing_hand, offset])
def test_what_is_no_load_alone_is_told_beside_the_mass(spoilt):
    robot, free = motion(0.0)
    found = weigh_load(robot, [spoilt(robot, free)], LINK)
    assert "are left in" in found.doubt and "touches the arm, a sensor fails" in found.doubt


def stuck_sensor(robot, free):
    stuck = replace(free, wrench=free.wrench.copy())
    stuck.wrench[HALF, 0] = stuck.wrench[500, 0]
    return stuck


@pytest.mark.parametrize("spoilt", [late_grasp, stuck_sensor])
def test_what_is_wrong_is_told_where_no_mass_is_found(spoilt):
    robot, free = motion(0.0)
    with pytest.raises(InputError, match=r"no load on tool: .* are left in .* a sensor fails"):
        weigh_load(robot, [spoilt(robot, free)], LINK)
