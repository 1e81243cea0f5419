# SPDX-License-Identifier: Apache-2.0
"""The classification benchmark: what is counted, and a few interactions through the pipeline."""

import csv

import pytest

from touchline.bench.classification import run as classification
from touchline.bench.classification.run import Verdict, judge, tables
from touchline.cli import main

NAN = float("nan")


def verdict(kind, said, zone="structure", clamped="free", said_clamped="free", delay=0.01):
    return Verdict(kind, zone, clamped, 20.0, said, zone, said_clamped, delay)


def rows(text, part):
    """The cells of one table, by what its rows are called."""
    lines = text.split("\n\n")[part].splitlines()[1:]
    return {
        line.split("  ")[0]: line.split("  ", 1)[1].replace(" %", "%").split() for line in lines
    }


def test_answers_are_counted_by_what_it_was():
    told = [
        verdict("contact", "contact", delay=0.02),
        verdict("contact", "collision", delay=0.03),
        verdict("collision", "collision", clamped="clamped, one segment", said_clamped="clamped"),
        Verdict("collision", "tool", "free", 80.0, "", "", "", NAN),
    ]
    text = tables(told)
    assert rows(text, 0) == {
        "collision": ["2", "0.0%", "50.0%", "0.0%", "50.0%"],
        "contact": ["2", "50.0%", "50.0%", "0.0%", "0.0%"],
    }
    assert list(rows(text, 1)) == ["structure", "tool"]  # clamps are left out
    assert rows(text, 1)["tool"][-1] == "100.0%"  # not noticed
    assert rows(text, 2)["clamped, one segment"] == ["1", "0.0%", "100.0%", "0.0%", "0.0%"]
    assert rows(text, 3) == {"contact": ["20"] * 4, "collision": ["10"] * 4}  # only right ones


def test_a_hand_and_a_blow_are_told_apart():
    hand, blow = judge(0), judge(1)
    assert (hand.kind, hand.said_kind, hand.said_zone) == ("contact", "contact", hand.zone)
    assert (blow.kind, blow.said_kind, blow.said_zone) == ("collision", "collision", blow.zone)
    assert blow.force > 3 * hand.force and blow.delay < 0.05 < hand.delay
    assert judge(1) == blow


def test_every_interaction_is_written_once(tmp_path, here, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    here(classification)
    monkeypatch.setattr(
        classification, "judge", lambda number, seed: verdict("contact", "contact", delay=number)
    )
    assert main(["bench", "classification", "--interactions", "43", "--out", str(tmp_path)]) == 0
    assert "sara, 43 interactions" in capsys.readouterr().out
    with (tmp_path / "classification.csv").open() as file:
        assert [float(row["delay"]) for row in csv.DictReader(file)] == list(range(43))
    assert main(["bench", "classification", "--interactions", "0"]) == 2
    assert "interactions" in capsys.readouterr().err
