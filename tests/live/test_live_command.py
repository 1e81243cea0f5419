# SPDX-License-Identifier: Apache-2.0
"""`touchline live` on the command line: what it prints, and bad input."""

import json

import pytest

from touchline.cli.main import main


def run(capsys, *arguments):
    status = main(["live", "--robot", "sara", *arguments])
    return status, *capsys.readouterr()


def test_contacts_are_told_as_they_come(capsys, tmp_path):
    path = tmp_path / "x.mcap"
    events = tmp_path / "new" / "events.jsonl"
    options = ["--source", "sim://?speed=0", "--record", str(path), "--duration", "7"]
    options += ["--events", str(events)]
    status, out, err = run(capsys, *options)
    assert status == 0 and err == ""
    told = [line for line in out.splitlines() if "contact" in line]
    assert "2.0" in told[0] and "on tool" in told[0]
    assert "over after" in told[1] and "20." in told[1]
    assert "7001 samples, 2 events" in out and str(path) in out
    written = [json.loads(line) for line in events.read_text().splitlines()]
    assert [event["id"] for event in written] == [0, 1]
    assert written[0]["link"] == "tool" and written[0]["cleared"] > written[0]["detected"]


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("sims://", "did you mean 'sim'"),
        ("robot", "expected one of sim://"),
        ("sim://host", "expected sim://"),
        ("sim://?sped=1", "did you mean 'speed'"),
        ("sim://?speed=-1", "must be a number"),
        ("sim://?speed=fast", "must be a number"),
        ("replay://", "path of a recording"),
        ("replay:///nowhere/log.mcap", "no such file"),
    ],
)
def test_a_bad_source_is_one_clear_line(capsys, source, words):
    status, out, err = run(capsys, "--source", source)
    assert status == 2 and words in err and "Traceback" not in err
    assert len(err.strip().splitlines()) == 1


def test_a_bad_duration_or_recording(capsys, tmp_path):
    status, _, err = run(capsys, "--source", "sim://", "--duration", "0")
    assert status == 2 and "--duration" in err
    status, _, err = run(capsys, "--source", "sim://?speed=0", "--record", str(tmp_path / "x.csv"))
    assert status == 2 and ".mcap or .parquet" in err
    taken = tmp_path / "taken"
    taken.write_text("")
    status, _, err = run(capsys, "--source", "sim://", "--events", str(taken / "x.jsonl"))
    assert status == 2 and f"--events {taken / 'x.jsonl'}: cannot be written" in err
    assert len(err.strip().splitlines()) == 1


def test_a_robot_that_does_not_fit_is_refused_unless_forced(capsys, tmp_path):
    log = tmp_path / "moving.parquet"
    assert main(["simulate", "free_motion", "--out", str(log), "--speed", "0.5"]) == 0
    capsys.readouterr()
    source = f"replay://{log}?speed=0"
    status, out, err = run(capsys, "--source", source)
    assert status == 2 and "not live: standstill: the robot moves" in err and "--force" in err
    assert not out.count("live;")
    status, out, err = run(capsys, "--source", source, "--force", "--duration", "2")
    assert status == 0 and err == "" and "forced, in spite of standstill" in out
