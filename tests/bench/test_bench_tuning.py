# SPDX-License-Identifier: Apache-2.0
"""What half and double of tuning numbers do: a few of them, on the benchmark's own recordings."""

import json
from dataclasses import replace

import pytest

from touchline.bench.tuning.effect import Outcome, effect, outcome
from touchline.bench.tuning.recordings import recordings
from touchline.bench.tuning.run import main, summarized
from touchline.errors import InputError

USUAL = Outcome(9, 9, 9, 0, 0, [0.002], [0.01], ["a"])


@pytest.fixture(scope="module")
def healthy():
    return recordings()[0]


def test_all_touches_are_found_with_the_defaults(healthy):
    found = outcome(healthy, {})
    assert found.found == found.touches == found.right == 9
    assert found.false == found.faults == 0
    assert found.error < 4.0


def test_a_number_that_matters_has_an_effect_and_one_of_blows_has_none(healthy):
    standing = healthy[:1]
    usual = outcome(standing, {})
    assert effect(usual, outcome(standing, {})) == "="
    assert "found -" in effect(usual, outcome(standing, {"observer.settled_steps": 1000.0}))
    assert effect(usual, outcome(standing, {"gates.returns": 4.0})) == "="


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"told": ["b"]}, "~"),
        ({"told": ["b"], "found": 8, "false": 2}, "found -1, false +2"),
        ({"told": ["b"], "errors": [0.003]}, "+1.00 mm"),
        ({"told": ["b"], "errors": []}, "a place is not a number"),
        ({"told": ["b"], "delays": [0.015]}, "+5 ms"),
    ],
)
def test_an_effect_in_words(changes, text):
    assert effect(USUAL, replace(USUAL, **changes)) == text


def test_some_numbers_are_tried_and_written(tmp_path, capsys):
    main(["events"], tmp_path / "tuning.json")
    assert "events.period_ratio" in capsys.readouterr().out
    told = json.loads((tmp_path / "tuning.json").read_text())
    assert set(told["numbers"]) == {"events.period_steps", "events.period_ratio"}
    assert told["summary"] == summarized(told["numbers"])


def test_an_unknown_number_is_refused():
    with pytest.raises(InputError, match="unknown tuning number 'detector.hnd'"):
        main(["detector.hnd"], None)
