# SPDX-License-Identifier: Apache-2.0
"""Where another place explains more than another force a contact may have begun to slide."""

import pytest
from program import COMPILER, PLAIN

import touchline as tl

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C++ compiler on this machine")


@pytest.fixture(scope="module")
def said(tmp_path_factory, run_whole):
    """Of changes of a place [m], and of a force [N]: their size, and what is said of each."""
    folder = tmp_path_factory.mktemp("known")
    tl.Pipeline(tl.load_robot("sara")).export(folder / "sara.touchline")
    lines = [line.split() for line in run_whole("known_fit", PLAIN, folder / "sara.touchline")]
    return {
        what: [
            (float(size), *(word == "1" for word in words))
            for w, size, *words in lines
            if w == what
        ]
        for what in ("place", "force")
    }


def test_what_is_as_it_was_has_not_moved(said):
    size, explained, other_force, moved = said["place"][0]
    assert (size, explained, other_force, moved) == (0.0, True, False, False)


def test_a_slide_begins_before_known_contacts_cease_to_explain(said):
    """No sample is learnt from between what noise does and what is something new."""
    beyond = [moved for _, explained, _, moved in said["place"] if explained and moved]
    assert len(beyond) >= 3
    first = next(size for size, _, _, moved in said["place"] if moved)
    last = max(size for size, explained, _, _ in said["place"] if explained)
    assert 0.0 < first < last
    assert all(moved for size, explained, _, moved in said["place"] if explained and size >= first)


def test_a_force_that_changes_is_no_slide(said):
    changed = [moved for _, explained, other, moved in said["force"] if explained and other]
    assert len(changed) >= 10
    assert not any(moved for _, explained, _, moved in said["force"] if explained)
