# SPDX-License-Identifier: Apache-2.0
"""The reaction benchmark: what is counted, said and drawn of encounters that are made up."""

import csv
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from touchline.bench.reaction import figure
from touchline.bench.reaction import run as reaction
from touchline.cli import main
from touchline.reaction.reaction import REACTIONS
from touchline.trials.guiding import Guided
from touchline.trials.reacting import LINKS, SPEEDS, Case, Trial

NAN = float("nan")
NONE = Trial(
    "wall", "link5", 0.5, 0, "ignore", 2e4, np.inf, 200.0, 50.0, NAN, 0.04, NAN, 0.5, False, False
)


def encounter(case):
    """With every reaction; each acts after 5 ms and halves the force."""
    case = replace(NONE, scene=case.scene, link=case.link, speed=case.speed, seed=case.seed)
    acting = replace(case, peak=100.0, impulse=5.0, quiet=0.1, way=0.01, reacted=0.005)
    return [case, *(replace(acting, reaction=name) for name in REACTIONS if name != "ignore")]


def test_medians_stand_beside_those_without_a_reaction():
    trials = encounter(Case("wall", "link5", 0.5, 0)) + encounter(Case("wall", "tool", 0.25, 0))
    head, none, *acting = [line.split() for line in reaction.table(trials).splitlines()]
    assert none == "wall, ignore 2 200 1.00 1.000 50.0 - 2 40.0 -".split()
    assert len(acting) == len(REACTIONS) - 1
    assert acting[0] == f"wall, {acting[0][1]} 2 100 0.50 0.500 5.0 100 0 10.0 5".split()


def test_what_must_not_be_is_named():
    good = encounter(Case("wall", "link5", 0.5, 0))
    text = reaction.summary(good)
    assert "higher than without reaction: 0 of 3" in text and "in 1 of 1" in text
    assert "collision: 0 of 3" in text and len(text.splitlines()) == 4
    worse = [replace(t, peak=202.0) if t.reaction == "retract" else t for t in good]
    slow = [replace(t, quiet=0.4, reacted=NAN, false=True) for t in worse[1:]]
    text = reaction.summary([worse[0], *slow])
    assert "higher than without reaction: 1 of 3" in text and "in 0 of 1" in text
    assert "collision: 3 of 3" in text and "hand that leads: 3" in text
    assert "  higher: wall, link5 at 0.5 m/s, 20 kN/m, inf kg, retract: 202.0 N, 200.0 N" in text
    assert text.count("  slower: ") == 1 and text.count("  missed: ") == 3


@pytest.fixture
def made_up(here, monkeypatch):
    """No encounter is simulated; those in the figure press with 50 N for 10 ms."""
    here(reaction)
    time = np.arange(0.0, 0.8, 1e-3)
    outcome = SimpleNamespace(readings=SimpleNamespace(time=time))
    monkeypatch.setattr(reaction, "play", encounter)
    monkeypatch.setattr(
        reaction, "guide", lambda part: Guided(60.0, part, 0.9, 800.0, 1700.0, 25.0, 1.1)
    )
    monkeypatch.setattr(figure, "encounter_of", lambda case: None)
    monkeypatch.setattr(figure, "outcome_of", lambda *_: outcome)
    pulse = np.where(np.abs(time - 0.15) < 5e-3, 50.0, 0.0)
    monkeypatch.setattr(figure, "pressing", lambda _: pulse)


def test_every_encounter_is_played_written_and_drawn(made_up, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    words = ["--encounters", "1", "--guiding", "0.05", "--out", str(tmp_path)]
    assert main(["bench", "reaction", *words]) == 0
    told = capsys.readouterr().out
    cases = sum(len(LINKS[scene]) * len(SPEEDS[scene]) for scene in LINKS)
    assert f"sara, {cases} encounters" in told
    assert "guiding by the handle for 0.05 h: 3 collisions" in told
    assert "touch noticed 90.0 % of the time" in told and "at most 800 N/s" in told
    with (tmp_path / "reaction.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == cases * len(REACTIONS) and rows[0]["reaction"] == "ignore"
    for name in ("reaction", "reaction_time"):
        drawn = (tmp_path / f"{name}.svg").read_text()
        assert "axes_2" in drawn and "legend_1" in drawn


def test_without_guiding_nothing_is_said_of_it(made_up, capsys):
    assert main(["bench", "reaction", "--encounters", "1", "--guiding", "0"]) == 0
    assert "guiding by" not in capsys.readouterr().out
    assert main(["bench", "reaction", "--encounters", "0"]) == 2
    assert "encounters" in capsys.readouterr().err
