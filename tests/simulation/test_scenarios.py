# SPDX-License-Identifier: Apache-2.0
"""The scenarios' logs, read by the observer, give back their truth."""

import numpy as np
import pytest
from simulation_support import estimate, force_errors, strongest

from touchline.errors import InputError
from touchline.model.surface import link_surface
from touchline.simulation import random_push
from touchline.simulation.contacts import Profile
from touchline.simulation.noise import SensorNoise
from touchline.simulation.plant import Plant
from touchline.simulation.random_push import Timing, random_push_runs, random_pushes
from touchline.simulation.record import simulate_to_log
from touchline.simulation.scenario import (
    SCENARIOS,
    base_touch,
    colliding_pushers,
    demo,
    free_motion,
    singular_push,
    three_touches,
)
from touchline.simulation.scene import Run
from touchline.simulation.setup import read_setup
from touchline.simulation.shapes import convex_pieces
from touchline.simulation.touchable import TouchableSurface, structure_links

TOLERANCE = 0.05  # N


def test_contact_free_motion_leaves_no_residual(sara):
    simulated = free_motion(sara, seconds=2.0, speed=2.5)
    assert np.abs(simulated.samples.qd).max() > 2.0
    assert np.abs(estimate(sara, simulated.samples).segment_wrench).max() < 5e-3


@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_three_simultaneous_forces_are_read_off_their_segments(sara, speed):
    simulated = three_touches(sara, speed, seconds=0.7)
    np.testing.assert_allclose(strongest(simulated), 20.0, rtol=1e-9)
    assert force_errors(sara, simulated).max() < TOLERANCE
    together = (simulated.truth.link >= 0).all(axis=1)
    assert together.mean() > 0.5


def test_a_touch_of_the_innermost_link_is_read_at_the_base(sara):
    simulated = base_touch(sara, seconds=0.5)
    assert simulated.truth.links[simulated.truth.link.max()] == "link0"
    assert force_errors(sara, simulated).max() < TOLERANCE


def test_a_push_that_no_joint_can_feel_is_read_at_the_base(sara):
    simulated = singular_push(sara, seconds=0.5)
    assert strongest(simulated)[0] == pytest.approx(20.0)
    found = estimate(sara, simulated.samples)
    assert force_errors(sara, simulated).max() < TOLERANCE
    assert simulated.metadata["torque_per_newton"] < 0.005
    assert np.abs(found.tau_ext[:, 1:]).max() < 0.15


@pytest.fixture(scope="module", params=[0.0, 0.02])
def collided(request, sara):
    return colliding_pushers(sara, request.param, hold_time=0.1)


def test_forces_of_colliding_bodies_are_read_off_their_segments(sara, collided):
    simulated = collided
    forces = strongest(simulated)
    assert forces[::2].min() > 5.0
    assert force_errors(sara, simulated).max() < TOLERANCE


def test_colliding_bodies_touch_the_true_surface_from_outside(sara, collided):
    simulated = collided
    truth, surface = simulated.truth, TouchableSurface(sara)
    for slot in range(0, truth.link.shape[1], 2):
        row = int(np.argmax(np.linalg.norm(truth.force[:, slot], axis=1)))
        surface.place(sara.T_world_links(simulated.samples.q[row]))
        direction = truth.force[row, slot] / np.linalg.norm(truth.force[row, slot])
        distance, link, leaving = surface.hits(
            truth.point[row, slot] - 0.01 * direction, direction
        )[0]
        assert link == truth.links[truth.link[row, slot]] and not leaving
        assert distance == pytest.approx(0.01, abs=1.5e-3)


def test_the_demo_touches_three_segments_at_once_and_the_base(sara):
    simulated = demo(sara, 6.0, Run(physics=2000.0))
    segments = {link: body.segment for body in sara.bodies for link in body.links}
    touched = [
        {segments[simulated.truth.links[i]] for i in row[row >= 0]} for row in simulated.truth.link
    ]
    assert {"base", "wrist", "handle"} in touched
    inner = simulated.truth.links.index("link0")
    assert (simulated.truth.link == inner).any()


def test_random_pushes_are_reachable_and_within_the_friction_cone(sara):
    surface = TouchableSurface(sara)
    structure = structure_links(sara)
    for simulated in random_push_runs(sara, 12, force=(5.0, 50.0)):
        truth, row = simulated.truth, 250
        link = truth.links[truth.link[row, 0]]
        force, point = truth.force[row, 0], truth.point[row, 0]
        assert link in structure and 5.0 <= np.linalg.norm(force) <= 50.0
        poses = sara.T_world_links(simulated.samples.q[0])
        surface.place(poses)
        T, own = poses[link], surface.surfaces[link]
        at = T[:3, :3].T @ (truth.point[truth.link[:, 0] >= 0][0, 0] - T[:3, 3])
        distances = np.abs(np.einsum("fi,fi->f", own.normals, at - own.vertices[own.faces[:, 0]]))
        centers = np.linalg.norm(own.vertices[own.faces].mean(axis=1) - at, axis=1)
        face = np.argmin(distances + 0.1 * centers)
        normal = T[:3, :3] @ own.normals[face]
        assert -(force @ normal) / np.linalg.norm(force) > 0.85  # cos(atan(0.5)) = 0.894
        assert surface.reachable(T[:3, :3] @ at + T[:3, 3], normal)
        assert point[2] > 0
        assert force_errors(sara, simulated).max() < TOLERANCE * np.linalg.norm(force) / 20


def test_an_arm_on_springs_is_stable_in_every_pose(sara):
    rng, setup = np.random.default_rng(0), read_setup(sara)
    plant, stiffest = Plant(sara, 1000.0), np.inf
    for _ in range(100):
        q = rng.uniform(setup.lower, setup.upper)
        plant.reset(q)
        plant.evaluate()
        _, damping = plant.hold(q, setup.stiffness, setup.damping)
        plant.command(plant.gravity_torque())
        plant.data.qvel[:] = 0.01
        for _ in range(40):
            plant.evaluate()
            plant.accelerate()
            plant.integrate()
        assert np.abs(plant.qd).max() < 0.05
        stiffest = min(stiffest, (damping / setup.damping).min())
    assert stiffest < 0.95  # it was needed


def test_the_fast_way_of_pushing_is_the_same_physics(sara, monkeypatch):
    fast = list(random_push_runs(sara, 2))
    monkeypatch.setattr(random_push, "can_hold", lambda *_: False)
    slow = list(random_push_runs(sara, 2))
    for a, b in zip(fast, slow, strict=True):
        np.testing.assert_allclose(a.samples.q, b.samples.q, atol=1e-4)
        np.testing.assert_allclose(a.samples.wrench, b.samples.wrench, atol=0.1)
        np.testing.assert_allclose(a.truth.force, b.truth.force, atol=1e-9)
        np.testing.assert_allclose(a.truth.wrench_mean, b.truth.wrench_mean, atol=0.05)


def test_reachability_agrees_with_counting_crossings_of_all_triangles(sara):
    surface, rng = TouchableSurface(sara), np.random.default_rng(1)
    setup, answers = read_setup(sara), []
    for _ in range(40):
        poses = sara.T_world_links(rng.uniform(setup.lower, setup.upper))
        surface.place(poses)
        at = surface.draw(rng, structure_links(sara))
        T = poses[at.link]
        point, normal = T[:3, :3] @ at.point + T[:3, 3], T[:3, :3] @ at.normal
        answers.append(surface.reachable(point, normal))
        assert answers[-1] == reachable_by_counting(surface, poses, point, normal)
    assert {True, False} == set(answers)


def reachable_by_counting(surface, poses, point, normal):
    """Moeller and Trumbore's test with every triangle: odd crossings mean inside."""
    if min(point[2], (point + 0.03 * normal)[2]) < 0:
        return False
    for link, own in surface.surfaces.items():
        T = poses[link]
        origin = T[:3, :3].T @ (point + 1e-5 * normal - T[:3, 3])
        direction = T[:3, :3].T @ normal
        a, b, c = own.vertices[own.faces].transpose(1, 0, 2)
        h = np.cross(direction, c - a)
        slope = np.einsum("ij,ij->i", b - a, h)
        f = 1 / np.where(slope == 0, np.inf, slope)
        u = f * np.einsum("ij,ij->i", origin - a, h)
        w = np.cross(origin - a, b - a)
        v, t = f * (w @ direction), f * np.einsum("ij,ij->i", c - a, w)
        hit = (f != 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        if (t[hit] < 0.03).any() or hit.sum() % 2:
            return False
    return True


def test_convex_pieces_follow_a_surface_closely(sara):
    from scipy.spatial import ConvexHull

    surface = link_surface(sara.mechanism.links["link3"])
    hulls = [ConvexHull(points) for points in convex_pieces(surface)]
    middles = surface.vertices[surface.faces].mean(axis=1)
    depth = np.full(len(middles), -np.inf)
    for hull in hulls:
        out = hull.equations[:, :3] @ middles.T + hull.equations[:, 3:]
        depth = np.maximum(depth, -out.max(axis=0))
    assert depth.min() > -1e-4  # the hulls cover the surface
    assert surface.areas[depth < 1e-3].sum() > 0.97 * surface.areas.sum()


def test_the_same_seed_gives_the_same_numbers_and_another_does_not(sara):
    runs = [
        free_motion(sara, 0.05, settings=Run(seed=seed, noise=SensorNoise())) for seed in (3, 3, 4)
    ]
    for name in ("time", "q", "qd", "tau", "wrench"):
        first, second, other = (getattr(run.samples, name) for run in runs)
        np.testing.assert_array_equal(first, second)
        assert name == "time" or not np.array_equal(first, other)
    pushes = [random_pushes(sara, 2, settings=Run(physics=1000.0)) for _ in range(2)]
    np.testing.assert_array_equal(pushes[0].truth.point, pushes[1].truth.point)
    np.testing.assert_array_equal(pushes[0].samples.wrench, pushes[1].samples.wrench)


def test_pushes_in_one_log_are_apart_in_time(sara):
    simulated = random_pushes(sara, 3, timing=Timing(hold=0.1))
    steps = np.diff(simulated.samples.time)
    assert (steps > 0).all() and np.sort(steps)[-2:].min() == pytest.approx(1.0)
    assert simulated.metadata["count"] == 3
    found = estimate(sara, simulated.samples).segment_wrench
    begins = np.flatnonzero(steps > 0.5) + 1
    for begin in begins:  # the gap restarts the filters
        assert np.abs(found[begin : begin + 50]).max() < 0.05


def test_a_scenario_becomes_a_log_with_truth(sara, tmp_path):
    from touchline.logs import read_log, write_table

    path = tmp_path / "log.parquet"
    simulated = simulate_to_log(
        "base_touch", sara, path, write_table, Run(), {"seconds": 0.6, "force": 15.0}
    )
    read = read_log(path, sara.description)
    np.testing.assert_array_equal(read.wrench, simulated.samples.wrench)
    import json

    import pyarrow.parquet as pq

    table = pq.read_table(path)
    force = np.hypot.reduce([table[f"truth.contact.0.f{a}"].to_numpy() for a in "xyz"])
    assert force.max() == pytest.approx(15.0)
    told = [json.loads(value) for value in table.schema.metadata.values() if b"scenario" in value]
    index = int(table["truth.contact.0.link"].to_numpy().max())
    assert told[0]["truth.links"][index] == "link0"


def test_unknown_scenarios_and_options_are_refused(sara, tmp_path):
    with pytest.raises(InputError, match="did you mean 'free_motion'"):
        simulate_to_log("free_moton", sara, tmp_path / "x.parquet", print)
    with pytest.raises(InputError, match="did you mean 'seconds'"):
        simulate_to_log("demo", sara, tmp_path / "x.parquet", print, options={"second": 1})
    assert set(SCENARIOS) >= {"free_motion", "demo", "random_pushes"}


def test_profiles_rise_hold_and_fall():
    smooth = Profile(1.0, hold=1.0, rise=0.1, fall=0.2)
    assert [smooth.at(t) for t in (0.9, 1.05, 1.5, 2.2, 2.4)] == pytest.approx([0, 0.5, 1, 0.5, 0])
    assert Profile(0.0, shape="step").at(0.0) == 1.0
    assert Profile(0, 0, 0.1, 0.1, "half_sine").at(0.1) == pytest.approx(1.0)
    with pytest.raises(ValueError, match="bump"):
        Profile(0.0, shape="bump")
