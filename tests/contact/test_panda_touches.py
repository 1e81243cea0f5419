# SPDX-License-Identifier: Apache-2.0
"""A real Panda, joint torques only, touched by hand: which link was it?"""

import gzip
import os
from pathlib import Path

import numpy as np
import pytest

import touchline as tl

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("TOUCHLINE_DATA", ROOT.parent / "shared" / "data")) / "panda_touches"
LINKS = {"a": 7, "b": 6, "c": 5, "d": 4, "f": 2}  # by the first letter of the file's name


def read(path):
    with gzip.open(path, "rt") as file:
        log = np.genfromtxt(file, delimiter=",", names=True)[1:]  # the first sample may be odd
    signals = [np.stack([log[f"{name}{i}"] for i in range(7)], 1) for name in ("q", "dq", "tau_J")]
    return log["time"], *signals, log["label"] > 0.5


def touches_of(path, robot):
    """For each touch the event that overlaps it, or None."""
    time, q, qd, tau, touched = read(path)
    pipeline = tl.Pipeline(robot, period=float(np.median(np.diff(time))))
    pipeline.run(time, q, qd, tau)
    events = pipeline.events
    edges = np.diff(touched.astype(int), prepend=0)
    for begin, end in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=False):
        during = [
            e for e in events if e.detected < time[end] and (e.cleared or np.inf) > time[begin]
        ]
        yield during[0] if during else None


def shares(event):
    """Probability of each body, by its number."""
    share = np.zeros(8)
    for candidate in event.candidates if event is not None else ():
        share[int(candidate.body[-1])] += candidate.probability
    return share


@pytest.fixture(scope="module")
def judged():
    files = sorted(DATA.glob("*.csv.gz"))
    if not files:
        pytest.skip(f"no recordings in {DATA}")
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arm's model")
    robot = tl.load_robot(ROOT / "examples" / "robots" / "panda_hand.yaml")
    return [(LINKS[f.name[0]], shares(event)) for f in files for event in touches_of(f, robot)]


def test_the_touched_body_is_among_the_candidates(judged):
    confusion = np.zeros((8, 8), int)
    for link, share in judged:
        confusion[link, int(np.argmax(share))] += 1
    print("\ntouched (rows) against most probable body (columns)")
    print("        " + "".join(f"{i:5}" for i in range(8)))
    for link in sorted(set(LINKS.values())):
        print(f"link {link}  " + "".join(f"{n:5}" for n in confusion[link]))
    assert len(judged) > 100
    assert np.mean([share[link] > 0.01 for link, share in judged]) >= 0.95
    assert np.trace(confusion) >= 0.85 * len(judged)


def test_hardly_any_event_is_named_beyond_the_touched_body(judged):
    assert np.mean([np.argmax(share) > link for link, share in judged]) <= 0.02
    assert np.mean([share[link + 1 :].sum() for link, share in judged]) <= 0.1


def test_probabilities_hold_what_they_say(judged):
    """The smallest set with 90 % of the probability, and bodies named with more than 90 %."""
    inside = []
    for link, share in judged:
        order = np.argsort(-share)
        size = int(np.searchsorted(np.cumsum(share[order]), 0.9 * share.sum())) + 1
        inside.append(link in order[:size])
    sure = [np.argmax(share) == link for link, share in judged if share.max() > 0.9]
    assert np.mean(inside) >= 0.9
    assert len(sure) >= 20
    assert np.mean(sure) >= 0.97
