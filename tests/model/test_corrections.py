# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from touchline.model.corrections import corrected_inertia, load_inertia
from touchline.model.description import LinkCorrection, Load
from touchline.model.loading import read_robot_file
from touchline.model.mechanism import Inertia
from touchline.model.transforms import combine_inertias, rotation_quaternion, rotation_rpy


def points_inertia(points, masses):
    """Return the exact inertia of mass points: the definition, not the theorem."""
    com = masses @ points / masses.sum()
    r = points - com
    matrix = sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(masses, r, strict=True))
    return Inertia(masses.sum(), com, matrix)


def test_combination_is_exact():
    rng = np.random.default_rng(1)
    points, masses = rng.normal(size=(12, 3)), rng.uniform(0.1, 2, 12)
    whole = points_inertia(points, masses)
    groups = [slice(0, 3), slice(3, 7), slice(7, 12)]
    joined = combine_inertias([points_inertia(points[g], masses[g]) for g in groups])
    assert joined.mass == pytest.approx(whole.mass)
    np.testing.assert_allclose(joined.com, whole.com, atol=1e-14)
    np.testing.assert_allclose(joined.inertia, whole.inertia, atol=1e-13)


def test_combination_without_mass():
    empty = combine_inertias([Inertia.zero(), Inertia.zero()])
    assert empty.mass == 0.0
    np.testing.assert_array_equal(empty.com, 0)


def test_a_load_on_an_empty_link_is_the_load():
    load = load_inertia(Load("x", 0.35, (0, 0, 0.02), (1, 0.1, 0.2, 2, 0.3, 2.5)))
    joined = combine_inertias([Inertia.zero(), load])
    np.testing.assert_allclose(joined.com, [0, 0, 0.02])
    np.testing.assert_allclose(joined.inertia, [[1, 0.1, 0.2], [0.1, 2, 0.3], [0.2, 0.3, 2.5]])


def test_corrections_replace_what_they_name():
    body = Inertia(2.0, np.array([1.0, 2, 3]), np.eye(3))
    heavier = corrected_inertia(body, LinkCorrection(mass=3.0))
    assert heavier.mass == 3.0
    np.testing.assert_array_equal(heavier.com, body.com)
    np.testing.assert_array_equal(heavier.inertia, body.inertia)
    moved = corrected_inertia(body, LinkCorrection(com=(0, 0, 1), inertia=(1, 0, 0, 2, 0, 2)))
    assert moved.mass == 2.0
    np.testing.assert_array_equal(moved.com, [0, 0, 1])
    np.testing.assert_array_equal(moved.inertia, np.diag([1, 2, 2]))


def test_no_mass_means_no_inertia():
    body = Inertia(2.0, np.ones(3), np.eye(3))
    emptied = corrected_inertia(body, LinkCorrection(mass=0.0))
    np.testing.assert_array_equal(emptied.inertia, 0)


def test_loads_come_after_corrections(folder):
    path = folder / "robot.yaml"
    path.write_text(
        path.read_text() + "links: {hand: {mass: 0}}\nloads:\n"
        "  - {link: hand, mass: 1, com: [0, 0, 1]}\n  - {link: hand, mass: 1, com: [0, 0, 3]}\n"
    )
    _, mechanism = read_robot_file(path)
    hand = mechanism.links["hand"].inertia
    assert hand.mass == 2.0
    np.testing.assert_allclose(hand.com, [0, 0, 2])
    np.testing.assert_allclose(hand.inertia, np.diag([2, 2, 0]))


def test_warnings_follow_the_corrections(folder):
    urdf, path = folder / "arm.urdf", folder / "robot.yaml"
    whole, text = urdf.read_text(), path.read_text()
    emptied = whole.replace('<mass value="0.5"/>', '<mass value="0"/>')
    urdf.write_text(emptied)
    assert read_robot_file(path)[1].warnings == ()  # the locked finger's mass moves with the hand
    urdf.write_text(emptied.replace('<mass value="0.1"/>', '<mass value="0"/>'))
    assert "link 'hand': moves with joint 'elbow'" in read_robot_file(path)[1].warnings[0]
    path.write_text(text + "loads: [{link: hand, mass: 1}]\n")
    assert read_robot_file(path)[1].warnings == ()
    urdf.write_text(whole)
    assert read_robot_file(path)[1].warnings == ()
    path.write_text(text + "links: {hand: {mass: 0}, finger: {mass: 0}}\n")
    (warning,) = read_robot_file(path)[1].warnings  # the locked finger does not move
    assert warning.startswith(f"{path}: link 'hand': moves with joint 'elbow' but has no mass")


def test_rotations_agree():
    """Roll, pitch, yaw one after the other about fixed axes; quaternions of any length."""
    roll, pitch, yaw = 0.3, -0.8, 2.1

    def turn(axis, angle):
        half = np.zeros(4)
        half[0], half[1 + axis] = 3 * np.cos(angle / 2), 3 * np.sin(angle / 2)
        return rotation_quaternion(half)

    expected = turn(2, yaw) @ turn(1, pitch) @ turn(0, roll)
    np.testing.assert_allclose(rotation_rpy((roll, pitch, yaw)), expected, atol=1e-15)
    np.testing.assert_allclose(turn(2, np.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
