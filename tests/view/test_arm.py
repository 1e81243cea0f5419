# SPDX-License-Identifier: Apache-2.0
"""The live arm without its page: pushes, faults and methods, judged against the simulated truth."""

import numpy as np
import pytest

import touchline as tl
from touchline.check.felt import Felt
from touchline.health import Health
from touchline.localizer.skin import Skin
from touchline.simulation.control import Setpoint, sinusoids
from touchline.simulation.hands import Hand
from touchline.view.arm import Conditions, LiveArm
from touchline.view.faults import FAULTS
from touchline.view.history import ROWS_PER_SECOND, SECONDS, History
from touchline.view.judge import Judge, Touched, Verdict
from touchline.view.methods import METHODS
from touchline.view.motion import EASE, Switched
from touchline.view.readout import Speed, readout

FRAME = 33  # samples
PART = 5  # samples, after which the arm may react


@pytest.fixture(scope="module")
def robots():
    sara = tl.load_robot("sara")
    return sara, tl.load_robot("sara-full"), Skin(sara)


class Room:
    """An arm with somebody who feels for it."""

    def __init__(self, robots, method="segment", **conditions) -> None:
        sara, full, skin = robots
        self.arm = LiveArm(full, skin)
        self.arm.set(Conditions(**conditions))
        self.method = METHODS[method](sara, full, skin)
        self.judge = Judge(sara)
        self.go(0.2)

    def go(self, seconds, rows=FRAME):
        """Verdicts after some time, by segment; `speeds` are the largest of each part."""
        self.speeds = []
        for _ in range(round(seconds * 1000 / rows)):
            samples, truth = self.arm.advance(rows)
            self.felt = self.method.take(samples)
            self.arm.feel(self.felt.contacts, self.felt.tau_ext)
            verdicts = self.judge.judge(self.felt, truth, self.arm.hands.active())
            self.speeds.append(np.abs(samples.qd).max())
        return {verdict.segment: verdict for verdict in verdicts}

    def surface(self, link):
        """A ray, origin and direction, whose first entry is into a link, and that entry."""
        T = self.arm.robot.T_world_links(self.arm.q)[link]
        patch = next(patch for patch in self.arm.skin.patches if patch.link == link)
        middles = patch.surface.vertices[patch.surface.faces].mean(axis=1)
        target = T[:3, :3] @ middles[len(middles) // 3] + T[:3, 3]
        for angle in np.arange(0.0, 2 * np.pi, 0.3):
            eye = target + 1.5 * np.array([np.cos(angle), np.sin(angle), 0.3])
            entries = [c for c in self.arm.skin.crossings(self.arm.q, eye, target - eye) if c.entry]
            if entries[0].link == link:
                return eye, target - eye, entries[0]
        raise AssertionError(f"{link} cannot be seen")


@pytest.mark.parametrize(
    ("direction", "link"),
    [((1, 0, 0), "link4"), ((0, -1, 0.3), "link4"), ((0, 0, 1), "link4"), ((0, 1, 0), "link3")],
    ids=str,
)
def test_a_pull_in_any_direction_is_felt_where_a_push_would_act(robots, direction, link):
    """Link3 lies beside link4, so close that no finger fits between: there it is what is felt."""
    room = Room(robots)
    eye, _, seen = room.surface("link4")
    hand = room.arm.pull("link4", seen.position, eye, 25.0)
    hand.target = room.arm.grip(hand) + 0.3 * np.array(direction)
    verdict = room.go(1.0)["base"]
    (true,) = verdict.true
    assert verdict.contact.link == true.link == link
    assert np.linalg.norm(true.force) == pytest.approx(25.0, abs=0.1)  # the limit
    assert verdict.position_error < 0.01 and verdict.force_error < 1.0
    assert 0.0 < verdict.delay < 0.05
    normal = room.arm.skin.crossings(room.arm.q, true.point - 0.01 * true.force, true.force)[0]
    assert normal.entry and np.allclose(normal.position, true.point, atol=3e-3)
    hand.released = True
    calm = room.go(0.5)
    assert all(v.level == 0 and not v.true for v in calm.values())
    assert room.arm.hands.slots == [None] * len(room.arm.hands)


def test_a_push_by_a_ray_goes_straight_into_the_surface(robots):
    room = Room(robots, noise=False)
    hand = room.arm.press(*room.surface("handle")[:2], 20.0)
    assert hand.link == "handle" and np.linalg.norm(hand.force) == pytest.approx(20.0)
    verdict = room.go(0.6)["handle"]
    assert verdict.contact.link == "handle" and verdict.force_error < 0.1
    assert verdict.position_error < 2e-3
    assert room.arm.press(np.array([2.0, 0, 0]), np.array([0.0, 0.0, 1.0]), 20.0) is None


def test_pushes_on_all_segments_stay_until_they_are_removed(robots):
    room = Room(robots)
    for link in ("link3", "tool", "handle"):
        room.arm.press(*room.surface(link)[:2], 20.0)
    verdicts = room.go(1.0)
    assert [v.contact.link for v in verdicts.values()] == ["link3", "tool", "handle"]
    assert max(v.position_error for v in verdicts.values()) < 0.01
    room.arm.hands.release_all()
    assert all(v.level == 0 for v in room.go(0.5).values())


def test_where_there_is_no_room_the_oldest_hand_has_to_go(robots):
    arm = LiveArm(robots[1], robots[2])
    hands = [arm.push_anywhere(10.0) for _ in range(len(arm.hands))]
    arm.advance(100)
    another = arm.push_anywhere(10.0)
    kept = {id(hand) for hand in arm.hands.active()}
    assert id(another) in kept and len(kept) == len(arm.hands)
    assert sum(id(hand) in kept for hand in hands) == len(hands) - 1


@pytest.mark.parametrize("method", METHODS)
def test_every_method_feels_a_push_and_says_when_it_does_not_know(robots, method):
    room = Room(robots, method)
    assert all(v.level == 0 for v in room.go(0.4).values())
    room.arm.press(*room.surface("link4")[:2], 25.0)
    verdict = next(iter(room.go(1.0).values()))
    assert verdict.level > 0 and verdict.delay is not None
    text = readout([verdict], room.felt.health, Speed(1e-4, 1.0), {})
    assert "collision" in text or "contact" in text
    if method == "joint torques only":
        assert verdict.segment == "root" and np.isnan(room.felt.wrench).all()
        assert verdict.contact.candidates
    else:
        assert verdict.contact.link == "link4" and verdict.position_error < 0.02


def test_what_is_weaker_than_what_can_be_felt_is_told():
    able = {"link4": Felt("link4", "base", 5.0, 2.0, 6)}
    weak = Touched("link4", np.zeros(3), np.array([3.0, 0.0, 0.0]))
    strong = Touched("link4", np.zeros(3), np.array([0.0, 9.0, 0.0]))
    for true, told in ((weak, True), (strong, False)):
        verdict = Verdict("base", 0, None, (true,), None, None, None)
        text = readout([verdict], 0, Speed(), able)
        assert ("true touch: 3.0 N on link4 lies below what can be felt there" in text) == told


@pytest.mark.parametrize("fault", FAULTS)
def test_no_fault_goes_unnoticed_or_breaks_anything(robots, fault):
    room = Room(robots)
    room.arm.set(Conditions(fault=fault))
    verdicts = room.go(1.2)
    touched = {v.segment for v in verdicts.values() if v.level}
    if "silent" in fault:
        assert room.felt.health & Health.MISSING and not touched
    if "wrist sensor: 5 N offset" == fault:
        assert room.felt.health & Health.FAULTY and not touched  # a fault, never a contact
    if fault in ("none", "handle sensor: 20 ms late"):
        assert not touched
    room.arm.set(Conditions())
    room.go(0.7)
    assert not any(v.level for v in room.go(0.5).values())


def test_an_unknown_load_is_felt_at_the_tool(robots):
    room = Room(robots)
    room.arm.set(Conditions(payload=0.5))
    verdict = room.go(0.6)["wrist"]
    assert verdict.level > 0 and verdict.contact.wrench[2] == pytest.approx(-4.905, abs=0.3)
    room.arm.set(Conditions())
    assert room.go(0.6)["wrist"].level == 0


def test_switched_trajectory_is_smooth_and_its_derivatives_are_those_of_its_positions():
    moving = sinusoids([0.1, 0.2], [0.3, 0.5], [1.0, 0.7], [0.0, 1.0])
    pose = np.array([0.1, 0.2])
    at = Switched(pose, moving)
    times = np.arange(0.0, 3 * EASE, 1e-3)
    rows: list[Setpoint] = []
    for t in times:
        at.wanted = 0.5 < t < 0.5 + 1.6 * EASE
        rows.append(at(t))
    q, qd, qdd = (np.array([getattr(row, name) for row in rows]) for name in ("q", "qd", "qdd"))
    assert np.allclose(np.gradient(q, times, axis=0)[2:-2], qd[2:-2], atol=3e-3)
    assert np.allclose(np.gradient(qd, times, axis=0)[2:-2], qdd[2:-2], atol=2e-2)
    assert np.allclose(q[times < 0.5], pose) and np.allclose(q[-1], pose)
    middle = np.searchsorted(times, 0.6 + EASE)
    assert np.allclose(q[middle], moving(times[middle]).q)


def test_history_keeps_the_last_seconds_of_the_segments_it_knows():
    history = History(("a", "b"))
    time = np.arange(0.0, 15.0, 0.01)
    wrench = np.zeros((len(time), 1, 6))
    wrench[:, 0, 4] = time
    for part in np.array_split(np.arange(len(time)), 7):
        history.add(time[part], ("b",), wrench[part])
    x, _, my, _ = history.curves("b", 3)
    assert x[0] >= -SECONDS and x[-1] == 0.0
    assert len(x) == pytest.approx(SECONDS * ROWS_PER_SECOND, rel=0.3)
    assert np.allclose(np.diff(my), np.diff(x))
    assert np.isnan(history.curves("a", 0)[1]).all()


def test_a_hand_with_a_target_pulls_like_a_spring_up_to_its_limit():
    T = np.eye(4)
    hand = Hand("tool", np.zeros(3), target=np.array([0.1, 0, 0]), stiffness=100.0, limit=30.0)
    assert np.allclose(hand.wanted(T), [10.0, 0, 0])
    hand.target = np.array([0, 0, 5.0])
    assert np.allclose(hand.wanted(T), [0, 0, 30.0])
    hand.released = True
    assert np.allclose(hand.wanted(T), 0)


@pytest.mark.parametrize("reaction", ["stop", "float", "retract"])
def test_the_arm_reacts_and_goes_back_to_its_motion_when_it_is_left_alone(robots, reaction):
    room = Room(robots, stiffness=0.5, moving=True)
    room.arm.set(Conditions(moving=True, stiffness=0.5, reaction=reaction))
    room.go(2.5, PART)
    assert room.arm.reacting is None
    room.arm.press(*room.surface("link4")[:2], 20.0)
    room.go(0.6, PART)
    assert room.arm.reacting == reaction
    # Its own jerk would look like a blow.
    assert [contact.level for contact in room.felt.contacts] == ["contact"]
    if reaction == "stop":
        assert max(room.speeds[-20:]) < 0.02 < room.speeds[0]
    room.arm.hands.release_all()
    room.go(4.0, PART)
    assert room.arm.reacting is None
    assert max(room.speeds[-200:]) > 0.05 and max(room.speeds) < 3.0
    goal = room.arm._trajectory(room.arm.time)
    assert np.abs(goal.q - room.arm.q).max() < 0.05


@pytest.mark.parametrize("method", METHODS)
def test_whatever_method_feels_the_push_the_arm_moves_away_from_it(robots, method):
    room = Room(robots, method, stiffness=1.0, reaction="retract")
    room.go(0.3)
    hand = room.arm.press(*room.surface("link4")[:2], 25.0)
    begin = room.arm.grip(hand)
    room.go(0.6, PART)
    assert room.arm.reacting == "retract"
    way = (room.arm.grip(hand) - begin) @ hand.acting / np.linalg.norm(hand.acting)
    assert 0.03 < way < 0.1  # 0.05 m are asked for


@pytest.mark.parametrize("stiffness", [0.2, 1.0])
def test_a_stretched_arm_is_held_steady_however_stiff_it_is(robots, stiffness):
    _, full, skin = robots
    arm = LiveArm(full, skin)
    arm.set(Conditions(stiffness=stiffness, noise=False))
    home = arm.q
    # Stretched and all but straight, joint 3 has a ninth of the inertia that it has at home.
    arm.lead(np.array([-0.1, 0.0, 0.0, 0.005, 0.0, 0.17, 0.0]) - home)
    arm._plant.reset(np.array([-0.1, 0.0, 0.0, 0.005, 0.0, 0.17, 0.02]))
    arm._plant.evaluate()
    samples, _ = arm.advance(300)
    assert np.abs(samples.qd).max() < 2.0
    assert np.abs(samples.qd[-50:]).max() < 0.05


def test_resuming_is_smooth_and_ends_on_the_trajectory():
    moving = sinusoids([0.1, 0.2], [0.3, 0.5], [1.0, 0.7], [0.0, 1.0])
    at = Switched(np.array([0.1, 0.2]), moving)
    at(0.0)
    q = np.array([-0.4, 0.9])
    at.resume(q, 1.0)
    assert np.allclose(at(1.0).q, q) and np.allclose(at(1.0).qd, 0.0)
    times = np.arange(1.0, 1.0 + 1.5 * EASE, 1e-3)
    positions = np.array([at(t).q for t in times])
    rates = np.array([at(t).qd for t in times])
    assert np.allclose(np.gradient(positions, times, axis=0)[2:-2], rates[2:-2], atol=3e-3)
    assert np.allclose(positions[-1], [0.1, 0.2])
