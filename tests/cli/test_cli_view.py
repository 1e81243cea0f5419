# SPDX-License-Identifier: Apache-2.0
"""`touchline view`: what it takes, and what it says where it cannot."""

import numpy as np
import pytest
from free_motion import free_motion

import touchline as tl
from touchline.cli import main
from touchline.logs import write_table


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    robot = tl.load_robot("sara")
    path = tmp_path_factory.mktemp("view") / "log.parquet"
    write_table(path, free_motion(robot, seconds=1.0, rate=200.0), robot.description)
    return path


@pytest.fixture
def seen(monkeypatch):
    """Pages that were shown, without waiting for visitors; the browser is not opened."""
    pages = []

    def run(page):
        pages.append(page)

    pytest.importorskip("viser")
    monkeypatch.setattr("touchline.view.replay_page.ReplayPage.run", run)
    monkeypatch.setattr("touchline.view.server.open_page", pages.append)
    return pages


def test_a_log_is_analyzed_first_and_results_are_read(log, seen, tmp_path, capsys):
    out = tmp_path / "results"
    arguments = ["view", str(log), "--robot", "sara", "--out", str(out), "--port", "0"]
    assert main([*arguments, "--no-browser"]) == 0
    assert (out / "estimates.parquet").is_file() and len(seen) == 1
    assert "http://127.0.0.1:" in capsys.readouterr().out
    assert main(["view", str(out), "--port", "0"]) == 0
    assert seen[1].startswith("http://127.0.0.1:")
    first, second = seen[0].replay, seen[2].replay
    np.testing.assert_array_equal(first.posture(0.3), second.posture(0.3))


def test_without_out_nothing_is_left(log, seen, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert main(["view", str(log), "--robot", "sara", "--port", "0", "--no-browser"]) == 0
    assert len(seen) == 1 and list(tmp_path.iterdir()) == []


def complaint(capsys, *arguments):
    assert main(["view", *map(str, arguments)]) == 2
    return capsys.readouterr().err


def test_bad_input_is_named(log, tmp_path, capsys):
    assert "a recording needs --robot" in complaint(capsys, log)
    assert "nothere" in complaint(capsys, tmp_path / "nothere", "--robot", "sara")
    (tmp_path / "empty").mkdir()
    assert "is empty" in complaint(capsys, tmp_path / "empty", "--robot", "sara")
    part = tmp_path / "part"
    part.mkdir()
    (part / "events.json").write_text("[]")
    said = complaint(capsys, part)
    assert "analysis.json" in said and "estimates.parquet" in said and "missing" in said
    assert "holds results already" in complaint(capsys, part, "--out", tmp_path / "x")
    assert "robot" in complaint(capsys, log, "--robot", "r2d2")
