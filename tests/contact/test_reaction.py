# SPDX-License-Identifier: Apache-2.0
"""Reactions as functions of a contact and a state, for any of them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import touchline as tl
from touchline.model.description import PolicyDescription, PolicyRule
from touchline.observer.dynamics import inverse_dynamics, mass_matrix, point_jacobian
from touchline.reaction.reaction import (
    REACTIONS,
    STRAIGHT,
    Retract,
    escape_motion,
    stop,
    yielding,
)
from touchline.reaction.reactor import Reactor, limited
from touchline.reaction.state import Since, State
from touchline.result.contact import Contact

LINKS = ("link0", "link1", "link3", "link5", "link7", "tool", "handle")


@pytest.fixture(scope="module")
def sara():
    return tl.load_robot("sara")


def state_of(robot, seed, speed=2.0, since=False):
    rng = np.random.default_rng(seed)
    joints = [robot.mechanism.joints[name] for name in robot.joint_names]
    q = np.array([rng.uniform(joint.lower, joint.upper) for joint in joints])
    qd = speed * rng.uniform(-1, 1, len(q))
    began = Since(0.0, q - 0.01 * qd, q if rng.random() < 0.5 else None) if since else None
    torque, tau_ext = rng.normal(size=(2, len(q))) * 300.0
    return State(robot, 0.01, q, qd, torque, tau_ext, began)


def contact_of(state, link, seed, located=True):
    rng = np.random.default_rng([seed, 1])
    force = rng.normal(size=3) * rng.choice([1.0, 30.0, 1000.0])
    if not located:
        return Contact(
            "base", 0, "collision", wrench=np.r_[force, rng.normal(size=3)], decided=True
        )
    T = state.robot.T_world_links(state.q)[link]
    position = T[:3, :3] @ rng.uniform(-0.1, 0.1, 3) + T[:3, 3]
    return Contact(
        "base", 0, "collision", "located", link=link, position=position, force=force, decided=True
    )


seeds = st.integers(0, 10_000)


def test_inertia_and_bias_torque_are_those_of_newton_and_euler(sara):
    state = state_of(sara, 1)
    expected = inverse_dynamics(sara, state.q, state.qd, np.zeros(7)).torque
    assert state.bias_torque == pytest.approx(expected, abs=1e-5)
    assert state.inertia == pytest.approx(mass_matrix(sara, state.q)[0], abs=1e-9)


def test_lever_is_the_row_of_the_jacobian(sara):
    state = state_of(sara, 2)
    T, local = sara.T_world_links(state.q)["link5"], np.array([0.03, -0.02, 0.1])
    J = point_jacobian(sara, state.q, "link5", local)[:3]
    direction = np.array([0.6, 0.0, 0.8])
    lever = state.lever("link5", T[:3, :3] @ local + T[:3, 3], direction)
    assert lever == pytest.approx(direction @ J, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(seeds, st.sampled_from(sorted(REACTIONS)), st.sampled_from(LINKS), st.booleans())
def test_torques_stay_within_their_limits_for_any_contact(seed, name, link, located):
    robot = tl.load_robot("sara")
    state = state_of(robot, seed, since=True)
    contact = contact_of(state, link, seed, located)
    policy = PolicyDescription(rules=[PolicyRule(name)])
    command = Reactor(robot, policy).update([contact], state)
    assert command.reaction == name
    assert np.all(np.isfinite(command.torque))
    assert np.all(np.abs(command.torque) <= state.effort + 1e-9)


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_stop_takes_energy_out_and_keeps_the_direction(seed):
    robot = tl.load_robot("sara")
    age = float(np.random.default_rng([seed, 2]).choice([0.0, 0.05, 0.35]))
    state = state_of(robot, seed)
    state = replace(state, since=Since(state.time - age, state.q))
    contact = contact_of(state, "link3", seed)
    push = stop(contact, state) - state.bias_torque
    power = float(push @ state.qd)
    fits = np.all(np.abs(state.bias_torque) <= state.effort)
    assert power <= 1e-9
    if age > 0.3:
        assert yielding(contact, state) is None
    if fits and yielding(contact, state) is None:
        deceleration = np.linalg.solve(state.inertia, push)
        cosine = deceleration @ state.qd / np.linalg.norm(deceleration) / np.linalg.norm(state.qd)
        assert cosine == pytest.approx(-1.0, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(seeds, st.sampled_from(LINKS[2:]))
def test_a_stop_never_drives_the_touched_point_against_the_contact(seed, link):
    """Whatever the filtered torques say yet; a point that leaves is not slowed down."""
    robot = tl.load_robot("sara")
    state = state_of(robot, seed)
    state = replace(state, since=Since(state.time - 0.01, state.q))
    contact = contact_of(state, link, seed)
    escape = escape_motion(contact, state)
    if escape is not None:
        push = stop(contact, state) - state.bias_torque
        leaving = float(escape[0] @ state.qd)
        acceleration = float(escape[0] @ np.linalg.solve(state.inertia, push))
        assert acceleration == pytest.approx(0.0, abs=1e-6) if leaving > 0 else acceleration >= 0


@settings(max_examples=60, deadline=None)
@given(seeds, st.sampled_from(LINKS[2:]))
def test_retract_accelerates_the_point_along_the_force(seed, link):
    robot = tl.load_robot("sara")
    state = state_of(robot, seed, speed=0.0)
    contact = contact_of(state, link, seed)
    direction = contact.force / np.linalg.norm(contact.force)
    lever = state.lever(link, contact.position, direction)
    torque, escape = Retract()(contact, state), escape_motion(contact, state, STRAIGHT)
    if escape is None:  # the point would rather slide, or not move at all
        assert torque == pytest.approx(stop(contact, state))
        return
    assert escape[0] == pytest.approx(lever, abs=1e-9)
    acceleration = np.linalg.solve(state.inertia, torque - state.bias_torque)
    if np.all(np.abs(state.bias_torque) < state.effort):
        assert lever @ acceleration > 0.0


@pytest.mark.parametrize("name", ["stop", "retract"])
def test_what_is_no_blow_is_answered_without_a_jerk(sara, name):
    state = state_of(sara, 4, speed=0.3)
    held = replace(contact_of(state, "link5", 4), level="contact")
    torques = []
    for age in (0.0, 0.001, 0.1):
        since = Since(state.time - age, state.q)
        torques.append(REACTIONS[name](held, replace(state, since=since)))
    begin, soon, late = (np.abs(torque - state.bias_torque).max() for torque in torques)
    assert begin == 0.0 < soon < 0.1 * late


def test_a_joint_near_its_limit_is_braked_and_that_is_told(sara):
    state = state_of(sara, 3)
    q, qd = np.zeros(7), np.zeros(7)
    q[1], qd[1] = state.range[1][1] - 0.01, 1.0
    state = State(sara, 0.0, q, qd, np.zeros(7))
    torque, told = limited(np.full(7, 500.0), state)
    acceleration = np.linalg.solve(state.inertia, torque - state.bias_torque)
    assert "position joint2" in told and "torque joint1" in told
    assert torque[1] < state.bias_torque[1] and np.isfinite(acceleration).all()


@pytest.mark.parametrize("name", [*REACTIONS, "own:odd"])
@settings(max_examples=20, deadline=None)
@given(seed=seeds, silent=st.lists(st.integers(0, 6), max_size=7))
def test_silent_sensors_leave_every_torque_finite(name, seed, silent):
    """A dead sensor makes the wrench of its segment, and torques that need it, unknown."""
    state = state_of(tl.load_robot("sara"), seed)
    state.tau_ext[silent] = np.nan
    contact = Contact(
        "wrist", 0, "collision", "wrench_only", wrench=np.full(6, np.nan), decided=True
    )
    reactor = Reactor(
        state.robot,
        PolicyDescription(rules=[PolicyRule(name)]),
        {"odd": lambda contact, state: np.full(7, np.nan)},
    )
    command = reactor.update([contact], state)
    assert np.isfinite(command.torque).all()
    assert (np.abs(command.torque) <= state.effort + 1e-9).all()
    if name == "own:odd":
        assert "no finite torque" in command.reason
