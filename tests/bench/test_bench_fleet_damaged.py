# SPDX-License-Identifier: Apache-2.0
"""A fleet of which some recordings are damaged in eight ways, while processes are killed."""

import sys
from dataclasses import replace

import pytest

import touchline.bench.fleet.run as bench
from touchline.bench.fleet.recordings import DAMAGES

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")


def test_every_recording_is_accounted_for_once(tmp_path, monkeypatch):
    monkeypatch.setattr(bench, "DAMAGED", 1 / 3)
    told = bench.chaos(tmp_path, 24, kills=4, stops=2, workers=2, seed=0)
    assert sorted(way for way in told.damages.values() if way) == sorted(DAMAGES)
    assert told.killed >= 2 and told.stopped == 2
    assert told.wrong() == []
    whole = [name for name, way in told.damages.items() if not way]
    assert all(told.found[name]["outputs"] for name in whole)
    # It tells what is wrong.
    row = told.found[whole[0]]
    for spoilt in ({whole[0]: row | {"outputs": {}}}, {whole[0]: row | {"status": "failed"}}):
        assert replace(told, found=told.found | spoilt).wrong()
    assert replace(told, lines=told.lines + 1).wrong()
    assert replace(told, found={k: told.found[k] for k in whole}).wrong()
