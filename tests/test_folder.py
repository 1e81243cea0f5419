# SPDX-License-Identifier: Apache-2.0
"""Results are replaced as a whole: whatever fails, old or new ones stand, never a mixture."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from free_motion import free_motion, pushed

import touchline as tl
from touchline import folder
from touchline.cli import main
from touchline.errors import InputError
from touchline.folder import UNFINISHED, ResultsFolder, check_file, replaced_file, settle
from touchline.logs import write_table

NAMES = ("a", "b", "c", "d")


def write(path, names, text):
    with ResultsFolder(path, NAMES) as results:
        for name in names:
            (results.draft / name).write_text(text)
        results.commit()


def contents(path):
    return {p.name: p.read_text() for p in path.iterdir() if p.is_file()}


def test_new_results_replace_all_older_ones(tmp_path):
    write(tmp_path / "r", "abc", "old")
    (tmp_path / "r" / "notes").write_text("mine")
    write(tmp_path / "r", "bd", "new")
    assert contents(tmp_path / "r") == {"b": "new", "d": "new", "notes": "mine"}
    assert {p.name for p in (tmp_path / "r").iterdir()} == {"b", "d", "notes"}


class Killed(BaseException):
    """Stands for the end of the process."""


@pytest.mark.parametrize("fatal", range(40))
def test_a_kill_at_any_step_leaves_old_or_new_results(tmp_path, monkeypatch, fatal):
    """Whatever the last thing was that the system was asked for."""
    write(tmp_path, "abc", "old")
    count = [0]

    def counted(function):
        def step(*arguments, **options):
            count[0] += 1
            if count[0] > fatal:
                raise Killed
            return function(*arguments, **options)

        return step

    with monkeypatch.context() as patch:
        for name in ("replace", "rename", "unlink", "rmdir", "fsync", "mkdir"):
            patch.setattr(folder.os, name, counted(getattr(os, name)))
        try:
            write(tmp_path, "bcd", "new")
            killed = False
        except Killed:
            killed = True
    before = contents(tmp_path)
    settle(tmp_path)
    after = contents(tmp_path)
    old, new = dict.fromkeys("abc", "old"), dict.fromkeys("bcd", "new")
    assert after in (old, new)
    assert killed or before == after == new
    write(tmp_path, "a", "next")
    assert contents(tmp_path) == {"a": "next"}
    assert not (tmp_path / UNFINISHED).exists()


def test_one_process_at_a_time(tmp_path):
    with ResultsFolder(tmp_path, NAMES) as results:
        (results.draft / "a").write_text("first")
        with pytest.raises(InputError, match="another process is writing"):
            ResultsFolder(tmp_path, NAMES)
        assert (results.draft / "a").read_text() == "first"
        results.commit()
    with ResultsFolder(tmp_path, NAMES):
        pass


def test_a_folder_that_cannot_be_had(tmp_path):
    (tmp_path / "file").write_text("precious")
    with pytest.raises(InputError, match="is a file"):
        ResultsFolder(tmp_path / "file", NAMES)
    with pytest.raises(InputError, match="cannot be written"):
        ResultsFolder(tmp_path / "file" / "r", NAMES)


def test_a_file_is_replaced_when_the_new_one_is_whole(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("old")
    path.chmod(0o640)
    with pytest.raises(RuntimeError), replaced_file(path) as draft:
        draft.write_text("half")
        assert draft.suffix == ".csv" and path.read_text() == "old"
        with pytest.raises(InputError, match="another process"), replaced_file(path):
            pass
        raise RuntimeError
    assert contents(tmp_path) == {"x.csv": "old"}
    (tmp_path / "link.csv").symlink_to(path)
    with replaced_file(tmp_path / "link.csv") as draft:
        draft.write_text("new")
    assert path.read_text() == "new" and (tmp_path / "link.csv").is_symlink()
    assert path.stat().st_mode & 0o777 == 0o640
    assert {p.name for p in tmp_path.iterdir()} == {"x.csv", "link.csv"}


def test_a_device_is_written_to(tmp_path):
    with replaced_file(Path(os.devnull)) as draft:
        draft.write_text("gone")
    assert not Path(os.devnull).is_file() and Path(os.devnull).exists()


def test_what_cannot_be_written_is_told_before_the_work(tmp_path):
    (tmp_path / "file").write_text("x")
    for path in (tmp_path, tmp_path / "file" / "x.csv"):
        with pytest.raises(InputError, match="cannot be written"):
            check_file(path)
    check_file(tmp_path / "deep" / "x.csv")
    check_file(tmp_path / "file")
    assert (tmp_path / "file").read_text() == "x"
    assert not list((tmp_path / "deep").iterdir())


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    robot = tl.load_robot("sara")
    samples = free_motion(robot, seconds=5.0, rate=200.0)
    samples = pushed(robot, samples, "link0", slice(500, 600), [30.0, 0.0, 0.0])
    path = tmp_path_factory.mktemp("logs") / "log.parquet"
    write_table(path, samples, robot.description)
    return path


@pytest.fixture
def results(log, tmp_path):
    assert main(["analyze", str(log), "--robot", "sara", "--out", str(tmp_path / "r")]) == 0
    return tmp_path / "r"


def everything(path):
    return {p.name: p.read_bytes() for p in path.iterdir() if p.is_file()}


def command(*arguments):
    return [sys.executable, "-m", "touchline", *map(str, arguments)]


ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(tl.__file__).parents[1])}


def started(*arguments):
    nothing = subprocess.DEVNULL
    return subprocess.Popen(command(*arguments), env=ENVIRONMENT, stdout=nothing, stderr=nothing)


def of_one_run(path, period):
    """Whether the files of a folder were made together."""
    import pyarrow.parquet as pq

    told = json.loads((path / "analysis.json").read_text())
    stamps = pq.read_table(path / "estimates.parquet")["time"].to_numpy()
    return told["method"] == period and told["samples"] == len(stamps)


def test_a_killed_analysis_leaves_old_or_new_results(log, results):
    before = everything(results)
    chance = np.random.default_rng(0)
    arguments = ["analyze", log, "--robot", "sara", "--out", results, "--method", "paper"]
    began = time.monotonic()
    assert started(*arguments).wait() == 0
    whole = time.monotonic() - began
    for _ in range(int(os.environ.get("TOUCHLINE_KILLS", "4"))):
        running = started(*arguments)
        time.sleep(whole * chance.uniform(0.4, 1.05))
        running.send_signal(signal.SIGKILL)
        running.wait()
        settle(results)
        assert of_one_run(results, "paper") and set(everything(results)) == set(before)
    # An old run stands where a killed one had hardly begun, and the next one clears up.
    assert started(*arguments).wait() == 0
    assert not (results / UNFINISHED).exists()


@pytest.mark.parametrize("bytes_left", [0, 3000, 60_000])
def test_a_full_disk_leaves_the_older_results(log, results, tmp_path, bytes_left):
    before = everything(results)

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_left, bytes_left))

    def refused(*arguments):
        run = subprocess.run(
            command(*arguments),
            env=ENVIRONMENT,
            preexec_fn=limit,
            capture_output=True,
            text=True,
            check=False,
        )
        assert run.returncode in (1, 2) and run.stderr.startswith("touchline: "), run.stderr
        assert "Traceback" not in run.stderr

    out = tmp_path / "new"
    refused("analyze", log, "--robot", "sara", "--out", results)
    assert everything(results) == before
    refused("analyze", log, "--robot", "sara", "--out", out)
    assert everything(out) == {}
    name = ("sim.parquet", "sim.csv")[bytes_left % 2000 == 0]
    refused("simulate", "free_motion", "--seconds", 2, "--out", tmp_path / name)
    assert not (tmp_path / name).exists()


def test_two_analyses_into_one_folder(log, results, capsys):
    before = everything(results)
    with ResultsFolder(results, ()):
        status = main(["analyze", str(log), "--robot", "sara", "--out", str(results)])
        assert status == 2 and "another process is writing there" in capsys.readouterr().err
    assert everything(results) == before
