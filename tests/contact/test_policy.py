# SPDX-License-Identifier: Apache-2.0
"""The policy table: which rule decides, and what is said of bad keys."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import touchline as tl
from touchline.model.description import ForceLimit, PolicyDescription, PolicyRule
from touchline.reaction.policy import Policy
from touchline.reaction.reactor import Reactor
from touchline.reaction.state import State
from touchline.result.contact import Contact

RULES = [
    PolicyRule("ignore", zone="handle"),
    PolicyRule("retract", level="collision", force=50.0),
    PolicyRule("stop", level="collision"),
    PolicyRule("float", level="contact", segment="wrist", link="tool"),
]


def contact(level="contact", force=20.0, segment="base", link="link3", zone="structure", **more):
    pushed = np.array([force, 0.0, 0.0])
    known = {"decided": True, **more}
    place = np.zeros(3)
    return Contact(
        segment, 0, level, "located", link=link, position=place, force=pushed, zone=zone, **known
    )


@given(
    st.sampled_from(["contact", "collision"]),
    st.floats(1.0, 300.0),
    st.sampled_from([("base", "link3", "structure"), ("wrist", "tool", "end_effector")]),
)
def test_the_first_rule_that_holds_decides(level, force, where):
    segment, link, zone = where
    choice = Policy(PolicyDescription(rules=RULES)).choose(
        contact(level, force, segment, link, zone)
    )
    if level == "collision":
        expected = "retract" if force >= 50.0 else "stop"
    else:
        expected = "float" if segment == "wrist" else "ignore"
    assert choice.reaction == expected
    assert choice.lasting == (level == "collision")


def test_rules_wait_for_the_decision_and_limits_do_not():
    description = PolicyDescription(rules=RULES, limits={"link3": ForceLimit(100.0, 40.0, "float")})
    policy = Policy(description)
    assert policy.choose(contact("collision", 60.0, decided=False)).reaction == "ignore"
    assert policy.choose(contact(force=110.0, decided=False)).reaction == "float"
    assert policy.choose(contact("collision", 60.0)).reaction == "retract"
    late = policy.choose(contact("collision", 60.0), duration=0.6)
    assert late.reaction == "float" and "quasi-static limit 40" in late.reason


def state_of(robot, time):
    still = np.zeros(7)
    return State(robot, time, still, still, still, still)


def test_a_collision_goes_before_a_contact_and_stays_until_reset():
    robot = tl.load_robot("sara")
    rules = [PolicyRule("float", level="contact"), PolicyRule("stop", level="collision")]
    reactor = Reactor(robot, PolicyDescription(rules=rules))
    soft, hard = contact(), contact("collision", segment="wrist", link="tool")
    assert reactor.update([soft], state_of(robot, 0.0)).reaction == "float"
    assert reactor.update([], state_of(robot, 0.1)).reaction == "ignore"
    assert reactor.update([soft, hard], state_of(robot, 0.2)).reaction == "stop"
    assert reactor.update([soft], state_of(robot, 0.3)).reaction == "stop"
    reactor.reset()
    assert reactor.update([], state_of(robot, 0.4)).reaction == "ignore"


def test_a_contact_that_turns_out_to_be_a_collision_does_not_begin_anew():
    robot, begun = tl.load_robot("sara"), []

    def own(contact, state):
        begun.append(state.since.time)
        return state.torque

    reactor = Reactor(robot, PolicyDescription(rules=[PolicyRule("own:it")]), {"it": own})
    touches = [contact(), contact("collision"), contact("collision")]
    touches[2] = replace(touches[2], event=1)
    for i, touch in enumerate(touches):
        assert reactor.update([touch], state_of(robot, 0.1 * i)).reaction == "own:it"
    assert begun == [0.0, 0.0, 0.0]


def test_a_reaction_of_ones_own_is_called_and_its_torques_are_cut():
    robot = tl.load_robot("sara")
    policy = PolicyDescription(rules=[PolicyRule("own:kick")])
    reactor = Reactor(robot, policy, {"kick": lambda contact, state: np.full(7, 1e4)})
    command = reactor.update([contact()], state_of(robot, 0.0))
    assert command.reaction == "own:kick" and "torque joint1" in command.clipped
    assert np.all(np.abs(command.torque) <= state_of(robot, 0.0).effort)
    with pytest.raises(tl.InputError, match="own:kick"):
        Reactor(robot, policy)


def write(tmp_path, policy):
    path = tmp_path / "robot.yaml"
    sensor = "force_torque_sensors: [{name: base, link: link0}]"
    path.write_text(f"name: x\nmodel: robot:sara\n{sensor}\npolicy:\n{policy}")
    return path


def test_policy_is_read(tmp_path):
    text = """\
  zones: {handle: handle, link7: end_effector}
  onset: {handle: 2500}
  rules:
    - {level: collision, clamped: false, zone: structure, force: 30, reaction: retract}
    - {segment: base, link: link3, reaction: "own:mine"}
  limits: {link3: {transient: 280, quasi_static: 140, reaction: float}}
  transient_time: 0.3
  retract: {way: 0.1, speed: 0.2}
"""
    policy = tl.load_robot(write(tmp_path, text)).description.policy
    assert policy.rules[1] == PolicyRule("own:mine", segment="base", link="link3")
    assert policy.limits["link3"] == ForceLimit(280.0, 140.0, "float")
    assert policy.zones["link7"] == "end_effector" and policy.onset.handle == 2500.0


def test_one_bad_number_is_one_error(tmp_path):
    with pytest.raises(tl.InputError) as error:
        tl.load_robot(write(tmp_path, "  limits: {link3: {transient: -5}}\n"))
    (problem,) = error.value.problems
    assert "policy.limits.link3.transient: -5 is not allowed" in problem


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("rules: [{level: crash, reaction: stop}]", r"policy.rules\[0\].level: 'crash' is not"),
        ("rules: [{level: contact}]", r"policy.rules\[0\].reaction: is missing"),
        ("rules: [{reaction: halt}]", "did you mean|allowed: ignore, stop, float, retract"),
        ("rules: [{reaction: stop, links: link3}]", r"rules\[0\].links: unknown key"),
        ("rules: [{reaction: stop, link: link33}]", "unknown link 'link33'"),
        ("rules: [{reaction: stop, segment: bass}]", "unknown segment 'bass'"),
        ("rules: [{reaction: stop, force: -3}]", "force: -3 is not allowed"),
        ("rules: [{reaction: stop, clamped: maybe}]", "allowed: true, false"),
        ("rules: stop", "not a list"),
        ("limits: {link3: {reaction: stop}}", "has no number"),
        ("limits: {link3: {transient: 100, quasi_static: 140}}", "140 is above the transient"),
        ("limits: {limb: {transient: 100}}", "unknown link or segment 'limb'"),
        ("zones: {handle: knob}", "'knob' is not allowed"),
        ("onset: {tool: 3}", "unknown key; allowed: structure"),
        ("retract: {way: 0}", "way: 0 is not allowed"),
    ],
)
def test_bad_keys_are_named(tmp_path, line, said):
    with pytest.raises(tl.InputError, match=said):
        tl.load_robot(write(tmp_path, f"  {line}\n"))
