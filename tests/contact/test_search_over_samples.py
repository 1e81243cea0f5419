# SPDX-License-Identifier: Apache-2.0
"""A search for a place that takes many samples: what it says meanwhile, and where it ends."""

import numpy as np
import pytest

from touchline.pipeline.pipeline import Pipeline
from touchline.result.contact import Contact
from touchline.trials.cell import Cell
from touchline.trials.scene import arm_and_skin, make_pipeline, make_scene

NEWCOMER, WEAK = Cell("sara", 3, 1), Cell("sara", 1, 1, speed=0.5, force=2.0)
TREMBLING, TORQUES = Cell("sara", 2, 1, hands="trembling"), Cell("panda-torques", 1, 1)
# What came last is explained by many places at first, then by one.
RUNS = {NEWCOMER: 3, WEAK: 5, TREMBLING: 0, TORQUES: 4}
FEW, AS_IT_IS, ALL = 300, 1000, 1_000_000_000  # units of work in a sample


def samples_and_pipeline(cell: Cell, work: int):
    """The signals of a scene, and a pipeline with so many units of work in each sample."""
    robot, skin = arm_and_skin(cell.arm, cell.tier)
    tuning = {"place.search_work": work}
    pipeline = Pipeline(robot, skin=skin, torque_error=0.0, tuning=tuning)
    return make_scene(cell, RUNS[cell]).signals, pipeline


def follow(cell: Cell, work: int) -> list[list[Contact]]:
    """The contacts after every sample."""
    s, pipeline = samples_and_pipeline(cell, work)
    samples = zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True)
    return [pipeline.update(*sample).contacts for sample in samples]


def by_link(contacts: list[Contact]) -> list[Contact]:
    """The contacts in the order of the names of their links."""
    return sorted(contacts, key=lambda contact: str(contact.link))


@pytest.fixture(scope="module", params=RUNS, ids=["newcomer", "weak", "trembling", "torques"])
def cell(request) -> Cell:
    if request.param.arm == "panda-torques":
        pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arm's model")
    return request.param


@pytest.fixture(scope="module")
def few(cell: Cell) -> list[list[Contact]]:
    return follow(cell, FEW)


def test_less_work_in_a_sample_ends_at_the_same_places(cell, few):
    ends = [by_link(few[-1])] + [by_link(follow(cell, work)[-1]) for work in (AS_IT_IS, ALL)]
    for contacts in ends:
        assert [c.link for c in contacts] == [c.link for c in ends[-1]]
        assert len(contacts) == cell.contacts
        assert all(c.status == "located" for c in contacts)
        for one, other in zip(contacts, ends[-1], strict=True):
            assert np.linalg.norm(np.array(one.position) - np.array(other.position)) < 1e-3


def test_nothing_is_located_before_all_has_been_looked_at(few):
    early = [contact for contacts in few for contact in contacts if contact.searching]
    assert early
    assert all(contact.status != "located" for contact in early)
    assert not any(contact.searching for contact in few[-1])


def test_all_at_once_says_nothing_of_a_search(cell):
    assert not any(contact.searching for contacts in follow(cell, ALL) for contact in contacts)


def test_samples_in_parts_give_the_same_bits(cell, few):
    events = []
    for parts in (1, 7):
        s, pipeline = samples_and_pipeline(cell, FEW)
        for i in np.array_split(np.arange(len(s.time)), parts):
            pipeline.run(s.time[i], s.q[i], s.qd[i], s.tau[i], s.wrench[i])
        last = pipeline.contacts.sample == pipeline.contacts.sample.max()  # of the last part
        xyz = [pipeline.contacts.columns()[axis][last] for axis in "xyz"]
        np.testing.assert_array_equal(np.transpose(xyz), [c.position for c in few[-1]])
        events.append(pipeline.events)
    assert events[0] == events[1]


def test_of_touches_that_begin_together_one_is_looked_for_in_each_sample():
    """The first look at each is dear. The others are told at once, with their place yet to come."""
    robot, skin = arm_and_skin("sara", 1)
    signals = make_scene(Cell("sara", 4, 1, begin="together"), 0, 0).signals
    pipeline, looked = make_pipeline(robot, skin), []
    s = signals
    for sample in zip(s.time.tolist(), s.q, s.qd, s.tau, s.wrench, strict=True):
        contacts = pipeline.update(*sample).contacts
        if contacts and len(looked) < 3:
            assert [c.segment for c in contacts] == ["base", "wrist", "handle"]
            looked.append([c.status != "wrench_only" for c in contacts])
            waiting = [c for c in contacts if c.status == "wrench_only"]
            assert all(c.searching and not c.candidates for c in waiting)
    assert looked == [[True, False, False], [True, True, False], [True, True, True]]
