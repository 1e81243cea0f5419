# SPDX-License-Identifier: Apache-2.0
"""The deadline benchmark: which updates are timed, and what counts as late."""

import numpy as np
import pytest

from touchline.bench.deadline import run as deadline
from touchline.bench.deadline.run import BUDGET, Line, update_times
from touchline.cli import main
from touchline.trials.touches import Signals


class Slow:
    """A pipeline whose updates do nothing."""

    made = 0

    def __init__(self):
        Slow.made += 1
        self.samples = []

    def update(self, *sample):
        self.samples.append(sample[0])


def test_the_least_of_the_repeats_counts(monkeypatch):
    clock = iter([0, 9000, 10000, 11000, 20000, 23000, 30000, 38000])
    monkeypatch.setattr(deadline, "thread_time_ns", lambda: next(clock))
    two = np.zeros((2, 1))
    signals = Signals(np.array([0.0, 1e-3]), two, two, two, np.zeros((2, 0, 6)))
    Slow.made = 0
    assert update_times(Slow, signals, 2).tolist() == [3.0, 1.0]
    assert Slow.made == 2


def test_what_takes_longer_than_the_budget_is_late():
    times = np.array([1.0] * 98 + [BUDGET, BUDGET + 0.1])
    row = Line("sara", 2, "apart", "20 N", "at rest", times, times[-1:]).row()
    assert row[:6] == ("sara", "2", "apart", "20 N", "at rest", "100")
    assert row[6] == "1.0" and row[-3:] == ("125.1", "1.000 %", "125.1")


def test_a_line_for_each_kind_of_touch(monkeypatch, capsys):
    """The signals are made, and their samples go through pipelines that take no time."""
    seen = []

    def update_times(make, signals):
        seen.append(signals)
        return np.full(len(signals.time), 2.0)

    monkeypatch.setattr(deadline, "update_times", update_times)
    assert main(["bench", "deadline", "--updates", "1", "--robots", "sara"]) == 0
    lines = [line.split("  ") for line in capsys.readouterr().out.splitlines() if "sara" in line]
    cells = [[cell.strip() for cell in line if cell.strip()] for line in lines]
    assert len(cells) == len(seen) == 12
    assert [row[1] for row in cells] == ["0", "1", "2", "2", "3", "3", "4", "4", "1", "1", "2", "2"]
    assert {row[2] for row in cells[2:8]} == {"0.1 s apart", "together"} and cells[-2][
        2
    ] == "clamped"
    assert ["2 N", "5 N"] == [row[2] for row in cells[8:10]]
    assert all("0.000 %" in row for row in cells)
    still, moving = seen[1], seen[8]
    assert np.abs(still.qd).max() < 0.1 < np.abs(moving.qd).max()


@pytest.mark.parametrize("words", [["--updates", "0"], ["--seed", "-1"]])
def test_impossible_numbers_are_told(words, capsys):
    assert main(["bench", "deadline", "--robots", "sara", *words]) == 2
    assert words[0].strip("-") in capsys.readouterr().err


def test_samples_come_at_the_rate_that_is_asked_for(monkeypatch, capsys):
    made, periods = [], []

    def update_times(make, signals):
        made.append(make().robot)
        periods.append(np.diff(signals.time).mean())
        return np.full(len(signals.time), 2.0)

    monkeypatch.setattr(deadline, "update_times", update_times)
    given = ["--updates", "1", "--robots", "sara", "--rate", "4000"]
    assert main(["bench", "deadline", *given]) == 0
    assert "4000 Hz" in capsys.readouterr().out
    np.testing.assert_allclose(periods, 1.0 / 4000.0)
    assert len(made) == 12
