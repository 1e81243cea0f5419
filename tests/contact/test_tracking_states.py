# SPDX-License-Identifier: Apache-2.0
"""The life of a segment's contacts: only transitions of the table happen, and they do happen."""

import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import touchline as tl
from touchline.native import core
from touchline.simulation import scenario
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scene import Run

PAGE = Path(__file__).parents[2] / "docs" / "architecture.md"
TABLE = {(a, b) for a, b, _ in core.TURNS}


def transitions(robot, samples):
    pipeline = tl.Pipeline(robot, period=float(np.median(np.diff(samples.time))))
    pipeline.run(samples.time, samples.q, samples.qd, samples.tau, samples.wrench)
    counts = Counter()
    for a, b, times in pipeline._core.transitions():
        counts[a, b] += times
    return counts


@pytest.fixture(scope="module")
def counts():
    """Of touches on an arm that stands and one that moves, and of forces that begin together."""
    settings = Run(seed=0, noise=SensorNoise())
    robot = tl.load_robot("sara")
    total = Counter()
    for simulated in (
        scenario.three_touches(robot, settings=settings),
        scenario.three_touches(robot, speed=0.5, settings=settings),
        scenario.colliding_pushers(robot, settings=settings),
    ):
        total += transitions(robot, simulated.samples)
    return total


def test_only_transitions_of_the_table_happen(counts):
    assert set(counts) <= TABLE


def test_a_touch_begins_and_ends(counts):
    assert counts["quiet", "suspected"] == 9
    assert counts["suspected", "single"] == 9
    assert counts["single", "quiet"] == 3  # the other six touches last as long as their recordings


def test_every_state_can_be_left_and_is_reached_from_quiet():
    states = {a for a, _ in TABLE}
    assert states == {b for _, b in TABLE}
    reached, found = {"quiet"}, True
    while found:
        more = {b for a, b in TABLE if a in reached} - reached
        reached |= more
        found = bool(more)
    assert reached == states
    assert {a for a, b in TABLE if b == "quiet"} == states - {"quiet"}


def test_the_page_shows_the_table():
    rows = re.findall(r"^\| (\w+) \| (\w+) \| (.+?) \|$", PAGE.read_text(), flags=re.MULTILINE)
    shown = [row for row in rows if (row[0], row[1]) in TABLE]
    told = [(a, b, why) for a, b, why in core.TURNS if b != "quiet"]
    assert shown == told
