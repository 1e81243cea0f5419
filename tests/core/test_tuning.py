# SPDX-License-Identifier: Apache-2.0
"""Every tuning number is a documented member of `Tuning`, and Python has them all."""

import re
from pathlib import Path

import numpy as np
import pytest

import touchline as tl
from touchline.tuning import DEFAULTS

INCLUDE = Path(__file__).parents[2] / "core" / "include" / "touchline"
HEADERS = sorted((INCLUDE / "detail").glob("*/tuning.hpp"))
MEMBER = re.compile(r"^  (?:double|int) (\w+) = ([^;]+);")
DOUBLE = r"\b[Dd]ouble\b|ten times|[Ww]ith (one|three|five)\b"
CONSTANT = re.compile(r"^\s*(?:static )?constexpr (?:double|int|float|std::size_t) (k\w+)\b(?!\[)")


def members(header):
    """Name, default and the comment above each member; members in a row share one."""
    comment, found = [], []
    for line in header.read_text().splitlines():
        if line.startswith("  // ----"):
            comment = []
        elif line.startswith("  // "):
            comment = [line] if not comment or comment[-1] == "" else [*comment, line]
        elif match := MEMBER.match(line):
            found.append((match[1], float(match[2]), " ".join(x for x in comment if x)))
            if comment and comment[-1]:
                comment.append("")
        else:
            comment = []
    return found


@pytest.mark.parametrize("header", HEADERS, ids=lambda p: p.parent.name)
def test_each_member_tells_its_meaning_and_what_half_and_double_would_do(header):
    numbers = members(header)
    assert numbers
    for name, default, comment in numbers:
        assert len(comment) > 60, f"{name} is not explained"
        told = re.search(r"\b[Hh]alf\b|A tenth", comment) and re.search(DOUBLE, comment)
        assert told, f"{name}: what would half and double do?"
        assert DEFAULTS[f"{header.parent.name}.{name}"] == default


def test_python_has_all_numbers_and_no_others():
    told = {f"{h.parent.name}.{name}" for h in HEADERS for name, *_ in members(h)}
    assert set(DEFAULTS) == told


def test_what_stays_a_constant_has_a_reason_beside_it():
    bare = []
    for header in sorted((INCLUDE / "detail").rglob("*.hpp")):
        lines = header.read_text().splitlines()
        for before, line in zip(["", *lines], lines, strict=False):
            match = CONSTANT.match(line)
            plain = match and not re.search(r"= (std::|[A-Z]\w+::|6\.28|kEach|\d+ \* k|-std)", line)
            if plain and "//" not in line and "//" not in before:
                bare.append(f"{header.name}: {match[1]}")
    assert not bare


def test_names_that_two_modules_share_mean_the_same():
    names = [name.split(".")[1] for name in DEFAULTS]
    assert sorted(set(names)) == sorted(names)


def test_all_numbers_are_printed_with_their_units():
    text = str(tl.Tuning({"detector.hand": 4.0}))
    assert "detector.hand = 4 s" in text
    assert "gates.jump = 20\n" in text
    assert len(text.splitlines()) == len(DEFAULTS)
    assert repr(tl.Tuning({"detector.hand": 4.0})) == "Tuning({'detector.hand': 4.0})"
    assert tl.Tuning({"detector.hand": 4.0}).unit("detector.hand") == "s"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"detector.hnd": 1.0},
            "unknown tuning number 'detector.hnd'. Did you mean 'detector.hand'",
        ),
        ({"hand": 1.0}, r"Did you mean 'detector.hand'\? print\(touchline.Tuning\(\)\) lists all"),
        ({"xyz": 1.0}, r"unknown tuning number 'xyz'\. print"),
        ({"gates.sure": "2"}, "gates.sure is '2', but must be a number"),
        ({"detector.hand": np.nan}, "detector.hand is nan, but must be finite"),
        ({"gates.sure": 2.5}, "gates.sure is 2.5, but must be a whole number"),
    ],
)
def test_wrong_numbers_are_told(changes, message):
    with pytest.raises(ValueError, match=message):
        tl.Pipeline("sara", tuning=changes)


def test_a_number_that_is_changed_changes_what_the_pipeline_does():
    usual, cautious = (
        tl.Pipeline("sara"),
        tl.Pipeline("sara", tuning={"observer.settled_steps": 50.0}),
    )
    n, k = len(usual.robot.joint_names), len(usual.robot.sensor_names)
    still = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((k, 6))
    settled = []
    for pipeline in (usual, cautious):
        health = [pipeline.update(0.001 * i, *still).health for i in range(200)]
        settled.append(sum(not h & tl.Health.SETTLING for h in health))
    assert cautious.tuning["observer.settled_steps"] == 50.0
    assert settled[0] > settled[1] == 0
