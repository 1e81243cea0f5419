# SPDX-License-Identifier: Apache-2.0
"""A recording of touches on a robot that is as described: what they look like is no error."""

import json

import pytest

from touchline.cli import main


@pytest.mark.parametrize("seed", range(4))
def test_touches_that_last_to_the_end_are_no_wrong_description(tmp_path, seed):
    log, out = tmp_path / "log.parquet", tmp_path / "out"
    simulate = ["simulate", "three_touches", "--speed", "0.5", "--seed", str(seed)]
    assert main([*simulate, "--out", str(log)]) == 0
    assert (
        main(["analyze", str(log), "--robot", "sara", "--out", str(out), "--report", "none"]) == 0
    )
    told = json.loads((out / "analysis.json").read_text())
    assert told["findings"] == [] and told["standing"] == []
    assert json.loads((out / "events.json").read_text())
