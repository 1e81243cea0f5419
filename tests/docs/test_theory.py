# SPDX-License-Identifier: Apache-2.0
"""Each header of the core names the section of the theory that it implements."""

import re

import pytest
from prose import REPOSITORY

DETAIL = REPOSITORY / "core" / "include" / "touchline" / "detail"
THEORY = (REPOSITORY / "docs" / "theory.md").read_text()
SECTIONS = set(re.findall(r"^##+ (\d+(?:\.\d+)?)\.? ", THEORY, flags=re.MULTILINE))
NAMED = re.compile(r"^// Theory: docs/theory\.md, sections? (.+)\.$", flags=re.MULTILINE)


@pytest.mark.parametrize("header", sorted(DETAIL.rglob("*.hpp")), ids=lambda p: p.stem)
def test_a_header_names_existing_sections(header):
    named = NAMED.findall(header.read_text())
    assert len(named) == 1, f"{header.name} names no section of docs/theory.md"
    sections = set(re.findall(r"\d+(?:\.\d+)?", named[0]))
    assert sections, named
    assert sections <= SECTIONS, f"{header.name} names {sections - SECTIONS}"


def test_every_section_is_implemented_somewhere():
    named = {
        section
        for header in DETAIL.rglob("*.hpp")
        for line in NAMED.findall(header.read_text())
        for section in re.findall(r"\d+(?:\.\d+)?", line)
    }
    assert {s for s in SECTIONS if "." in s} <= named


def test_equations_are_numbered_in_their_section_one_after_the_other():
    for number, body in re.findall(r"^## (\d+)\. .*?\n(.*?)(?=^## |\Z)", THEORY, re.S | re.M):
        equations = re.findall(r"^    .*\((\d+)\.(\d+)\)\s*$", body, flags=re.MULTILINE)
        assert all(section == number for section, _ in equations), equations
        assert [int(n) for _, n in equations] == list(range(1, len(equations) + 1)), number
