# SPDX-License-Identifier: Apache-2.0
"""What is made of recordings is what was accepted; `make accept` takes a change."""

import copy
import json

import pytest
from referenced import (
    FOLDER,
    REAL,
    RECORDINGS,
    SIMULATED,
    Absent,
    accepted,
    changed,
    differences,
    outputs,
)


@pytest.mark.parametrize("name", RECORDINGS)
def test_outputs_are_those_that_were_accepted(name):
    assert accepted(name), f"{name} is new: `make accept`"
    try:
        recording = RECORDINGS[name]()
    except Absent as absent:
        pytest.skip(str(absent))
    found = changed(name, outputs(recording))
    assert not found, "\n".join(
        [f"{name}: {len(found)} outputs changed; `make accept` takes them", *found[:20]]
    )


def test_twelve_recordings_at_least_need_no_data():
    assert len(SIMULATED) >= 12 and len(REAL) >= 5


def test_no_reference_is_left_behind():
    assert {path.stem for path in FOLDER.glob("*.json")} == set(RECORDINGS)


def test_references_hold_events_faults_resets_and_silence():
    told = {name: accepted(name) for name in SIMULATED}
    assert sum(bool(t["events"]) for t in told.values()) >= 10
    assert not told["sara_free"]["events"]
    assert told["sara_stuck"]["faults"] and told["sara_gaps"]["resets"]
    assert "SENSOR_EXCLUDED" in told["sara_full_lost"]["health"]


def _places(value, at=()):
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, inner in items:
            yield from _places(inner, (*at, key))
    else:
        yield at, value


def test_each_change_of_an_output_is_found_and_rounding_is_none():
    whole = accepted("sara_full_moving")
    for at, value in _places(whole):
        other, close = copy.deepcopy(whole), copy.deepcopy(whole)
        to, near = other, close
        for key in at[:-1]:
            to, near = to[key], near[key]
        number = isinstance(value, float | int) and not isinstance(value, bool)
        to[at[-1]] = value * 1.001 + 1e-3 if number else f"not {value}"
        assert len(differences(whole, other)) == 1, at
        if isinstance(value, float):
            near[at[-1]] = value * (1.0 + 1e-8)
            assert differences(whole, close) == []
    shorter = {**whole, "events": whole["events"][:-1]}
    assert len(differences(whole, shorter)) == 1
    del shorter["events"]
    assert len(differences(whole, shorter)) == 1


def test_references_are_small():
    sizes = [path.stat().st_size for path in FOLDER.glob("*.json")]
    assert max(sizes) < 30_000 and sum(sizes) < 200_000
    assert all(json.loads(path.read_text()) for path in FOLDER.glob("*.json"))
