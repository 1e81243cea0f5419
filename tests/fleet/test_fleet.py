# SPDX-License-Identifier: Apache-2.0
"""Many recordings: each is accounted for once, whatever is wrong with it or kills its process."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from free_motion import free_motion, pushed
from test_workers import lives

import touchline as tl
from touchline.cli import main
from touchline.errors import InputError
from touchline.fleet.forecast import forecast, forecast_text
from touchline.fleet.manifest import MANIFEST, Manifest, configuration_hash
from touchline.fleet.plan import is_single, make_plan
from touchline.fleet.pool import Pool
from touchline.fleet.tables import COMMON
from touchline.fleet.work import Job, done
from touchline.folder import ResultsFolder
from touchline.logs import write_table
from touchline.logs.cdr import JOINT_STATE
from touchline.logs.mcap import SCENE
from touchline.logs.mcap_writer import McapWriter

OPTIONS = {"bandwidth": None, "method": "segment", "report": "none"}


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara")


@pytest.fixture(scope="module")
def made(robot, tmp_path_factory):
    """Six recordings, of which two are whole, and a list of them."""
    folder = tmp_path_factory.mktemp("logs")
    samples = free_motion(robot, seconds=2.0, rate=200.0)
    samples = pushed(robot, samples, "link0", slice(200, 300), [24.0, 18.0, 0.0])
    (folder / "a").mkdir()
    write_table(folder / "a" / "whole.parquet", samples, robot.description)
    write_table(folder / "b.csv.gz", samples, robot.description)
    data = (folder / "b.csv.gz").read_bytes()
    (folder / "cut.csv.gz").write_bytes(data[: int(0.7 * len(data))])
    (folder / "empty.parquet").write_bytes(b"")
    (folder / "foreign.mcap").write_bytes(b"no recording" * 99)
    write_table(folder / "other.csv", samples, robot.description)
    text = (folder / "other.csv").read_text().replace("q.joint1", "q.elsewhere", 1)
    (folder / "other.csv").write_text(text)
    (folder / "notes.txt").write_text("mine")
    (folder / "list.csv").write_text("log, robot\na/whole.parquet, sara\nmissing.csv, sara\n")
    return folder


STATUS = {
    "a/whole": "ok",
    "b": "ok",
    "cut": "partial",
    "empty": "failed",
    "foreign": "failed",
    "other": "failed",
}


def rows(out):
    lines = (out / MANIFEST).read_text().splitlines()
    found = [json.loads(line) for line in lines]
    assert len({row["name"] for row in found}) == len(found)
    return {row["name"]: row for row in found}


def run(*arguments):
    return main(["analyze", *map(str, arguments), "--report", "none"])


@pytest.fixture(scope="module")
def results(made, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    assert run(made, "--robot", "sara", "--out", out, "--workers", 2) == 3
    return out


def test_links_keep_their_names(made, tmp_path):
    """As a data set on disk has them, whose files are called by their hashes."""
    folder, store = tmp_path / "set", tmp_path / "store"
    (folder / "arm").mkdir(parents=True)
    store.mkdir()
    shutil.copy(made / "a" / "whole.parquet", store / "0a1b2c")
    (folder / "arm" / "one.parquet").symlink_to(store / "0a1b2c")
    (folder / "arm" / "again.parquet").symlink_to(store / "0a1b2c")
    (folder / "lost.parquet").symlink_to(tmp_path / "nowhere")
    plan = make_plan([str(folder)], "sara")
    told = {recording.name: recording.problem for recording in plan}
    assert told == {"arm/again": "", "lost": "a link that leads nowhere"}
    assert run(folder, "--robot", "sara", "--out", tmp_path / "out") == 3
    found = rows(tmp_path / "out")
    assert found["arm/again"]["status"] == "ok" and found["lost"]["status"] == "skipped"


def test_results_beside_recordings_are_none(made, tmp_path, monkeypatch):
    """As where somebody works in the folder of the recordings."""
    folder = tmp_path / "runs"
    folder.mkdir()
    shutil.copy(made / "a" / "whole.parquet", folder / "one.parquet")
    shutil.copy(made / "a" / "whole.parquet", folder / "two.parquet")
    monkeypatch.chdir(folder)
    assert run("one.parquet", "--robot", "sara", "--out", ".") == 0
    assert [r.name for r in make_plan(["."], "sara")] == ["one", "two"]
    assert run(".", "--robot", "sara", "--out", ".") == 0
    (folder / "two" / "touchline.unfinished" / "estimates.parts").mkdir(parents=True)
    shutil.copy(
        "one.parquet", folder / "two" / "touchline.unfinished" / "estimates.parts" / "0.parquet"
    )
    for word in (".", "*", "**", "**/*.parquet", str(folder / "**")):
        assert [r.name for r in make_plan([word], "sara")] == ["one", "two"], word
    assert set(rows(folder)) == {"one", "two"}


def for_viewers(path):
    """As `--foxglove` writes it: scenes, and no joint states."""
    writer = McapWriter(path, {})
    for topic, kind in (("/robot", SCENE), ("/tau_ext", "foxglove.JointStates")):
        writer.add_channel(topic, kind, "")
    writer.close()
    return path


def test_what_the_shell_expands_is_what_a_folder_holds(made, tmp_path, monkeypatch, capsys):
    """`analyze *` where earlier results are: they are no recordings that fail."""
    folder = tmp_path / "runs"
    folder.mkdir()
    for name in ("one", "two"):
        shutil.copy(made / "a" / "whole.parquet", folder / f"{name}.parquet")
    monkeypatch.chdir(folder)
    assert run("one.parquet", "two.parquet", "--robot", "sara", "--out", ".") == 0
    assert run("one.parquet", "--robot", "sara", "--out", ".") == 0  # its results lie open there
    (folder / "robot.yaml").write_text("name: x\nmodel: robot:sara\n")
    (folder / "shown.rrd").write_bytes(b"RRF2")
    for_viewers(folder / "shown.mcap")
    words = sorted(path.name for path in folder.iterdir())
    capsys.readouterr()
    assert run(*words, "--robot", "sara", "--out", ".") == 0
    told = capsys.readouterr().out
    (own,) = (line for line in told.splitlines() if "Touchline's own results" in line)
    names = ("fleet.html", "log.jsonl", "manifest.jsonl", "tables", "estimates.parquet")
    assert all(name in own for name in names) and "one" not in own
    assert "shown.mcap, shown.rrd: made for a viewer" in told and "robot.yaml" in told
    assert set(rows(folder)) == {"one", "two"}
    assert run(*words, "--robot", "sara", "--out", ".", "--dry-run") == 0
    assert "Touchline's own results" in capsys.readouterr().out
    assert run(".", "--robot", "sara", "--out", ".") == 0  # the folder says the same
    told = capsys.readouterr().out
    assert re.search(r"skipped .*shown.mcap: made for a viewer", told)
    assert set(rows(folder)) == {"one", "two"}


def test_one_that_is_no_recording_is_refused_in_words(made, results, tmp_path, capsys):
    own = "Touchline's own results"
    shown = for_viewers(tmp_path / "shown.mcap")
    estimates = results / "b" / "estimates.parquet"
    for path, reason in (
        (results / "fleet.html", own),
        (results / "tables", own),
        (estimates, own),
        (shown, "made for a viewer"),
    ):
        assert run(path, "--robot", "sara", "--out", tmp_path / "r") == 2, path
        told = capsys.readouterr().err
        assert reason in told and ".parquet, .csv" in told and "folders" in told
        assert not (tmp_path / "r").exists()
    assert run(estimates, shown, "--robot", "sara", "--out", tmp_path / "r") == 2
    told = capsys.readouterr().err
    assert own in told and "made for a viewer" in told and "name recordings" in told
    with pytest.raises(InputError, match="no such file"):
        make_plan([str(tmp_path / "fleet.html")], "sara")


def test_a_recording_may_be_called_as_a_result_is(made, results, tmp_path, capsys):
    """What a file is shows in its columns; and no recording is replaced by results."""
    recording = made / "a" / "whole.parquet"
    names = ("estimates.parquet", "contacts.parquet", "postures.parquet")
    runs = tmp_path / "runs"
    runs.mkdir()
    for name in names:
        shutil.copy(recording, runs / name)
    for word in (runs, runs / "*", f"file://{runs}", f"file://{runs / names[0]}"):
        if "://" in str(word):
            pytest.importorskip("fsspec", reason="fsspec is not installed: touchline[fleet]")
        plan = make_plan([str(word)], "sara")
        assert not plan.none and {r.name for r in plan} <= {n.split(".")[0] for n in names}
    assert run(runs / names[0], "--robot", "sara", "--out", tmp_path / "r") == 0
    for log in (recording, runs / names[1]):
        assert run(log, "--robot", "sara", "--out", runs) == 2
        assert "would be replaced by the results" in capsys.readouterr().err
    assert all((runs / n).read_bytes() == recording.read_bytes() for n in names)
    for name in names:
        own = results / "a" / "whole" / name
        assert run(own, "--robot", "sara", "--out", tmp_path / "no") == 2
        assert f"{own}: among Touchline's own results" in capsys.readouterr().err
        assert list(make_plan([str(recording), str(own)], "sara").none) == [str(own)]
    assert not (tmp_path / "no").exists()


def test_a_users_files_are_not_replaced_by_those_of_a_fleet(made, tmp_path, capsys):
    (tmp_path / "tables").mkdir()
    shutil.copy(made / "a" / "whole.parquet", tmp_path / "tables" / "mine.parquet")
    words = (made / "a", made / "b.csv.gz", "--robot", "sara", "--out", tmp_path)
    assert run(*words) == 2
    assert f"{tmp_path / 'tables'}: would be replaced" in capsys.readouterr().err
    assert (tmp_path / "tables" / "mine.parquet").is_file()
    shutil.rmtree(tmp_path / "tables")
    text = '{"audio": "a.wav", "text": "mine"}\n'
    (tmp_path / MANIFEST).write_text(text)
    assert run(*words) == 2
    assert f"{tmp_path / MANIFEST}: not by Touchline" in capsys.readouterr().err
    assert (tmp_path / MANIFEST).read_text() == text
    assert [path.name for path in tmp_path.iterdir()] == [MANIFEST]


def test_a_data_set_for_learning_is_told_by_the_plan(made, tmp_path, capsys):
    folder = tmp_path / "runs" / "droid"
    for name in ("meta", "data"):
        (folder / name).mkdir(parents=True)
    (folder / "meta" / "info.json").write_text('{"codebase_version": "v3.0"}')
    shutil.copy(made / "a" / "whole.parquet", folder / "data" / "file-000.parquet")
    assert run(folder, "--robot", "sara", "--out", tmp_path / "r") == 2
    assert f"`touchline label {folder} --out COPY`" in capsys.readouterr().err
    part = folder / "data" / "file-000.parquet"
    assert run(part, "--robot", "sara", "--out", tmp_path / "r") == 2
    assert f"{part}: of a LeRobot data set" in capsys.readouterr().err
    shutil.copy(made / "a" / "whole.parquet", tmp_path / "runs" / "one.parquet")
    for word in ("", "*", "**/*"):
        plan = make_plan([str(tmp_path / "runs" / word)], "sara")
        assert [r.name for r in plan] == ["one"] and list(plan.none) == [str(folder)], word
    assert run(tmp_path / "runs", "--robot", "sara", "--out", tmp_path / "r") == 0
    assert "of a LeRobot data set" in capsys.readouterr().out


def test_a_file_with_scenes_and_joint_states_is_a_recording(tmp_path):
    path = tmp_path / "both.mcap"
    writer = McapWriter(path, {})
    for topic, kind in (("/robot", SCENE), ("/joint_states", JOINT_STATE)):
        writer.add_channel(topic, kind, "")
    writer.close()
    assert [r.name for r in make_plan([str(path)], "sara")] == ["both"]


def test_one_recording_takes_the_robot_beside_it(made, tmp_path, capsys):
    """As each of several does, and as the plan says."""
    log = tmp_path / "day" / "one.parquet"
    log.parent.mkdir()
    shutil.copy(made / "a" / "whole.parquet", log)
    assert run(log, "--out", tmp_path / "out") == 2
    assert "no robot: give --robot, or put a robot.yaml beside it" in capsys.readouterr().err
    joints = [
        f"{{name: joint{k}{', torque: none' if k in (1, 6, 7) else ''}}}" for k in range(1, 8)
    ]
    text = f"name: x\nmodel: robot:sara\njoints: [{', '.join(joints)}]\n"
    (tmp_path / "robot.yaml").write_text(text)
    assert run(log, "--out", tmp_path / "out") == 0
    told = json.loads((tmp_path / "out" / "analysis.json").read_text())
    assert str(tmp_path / "robot.yaml") in json.dumps(told)


def test_every_recording_has_its_row(made, results):
    found = rows(results)
    assert {name: row["status"] for name, row in found.items()} == STATUS
    assert list(found) == sorted(found)
    whole, cut = found["a/whole"], found["cut"]
    assert whole["samples"] == 400 and whole["events"] == 1 and whole["reason"] == ""
    assert 200 < cut["samples"] < 400 and "cut off" in cut["reason"]
    assert "joint1" in found["other"]["reason"] and "empty" in found["empty"]["reason"]
    for name, row in found.items():
        assert set(row) >= {"content", "configuration", "touchline", "cpu_seconds", "memory_mb"}
        folder = results / name
        assert set(row["outputs"]) == {p.name for p in folder.glob("*") if row["outputs"]}
    journal = [json.loads(line) for line in (results / "log.jsonl").read_text().splitlines()]
    assert {line["name"] for line in journal} == set(STATUS)


def test_a_configuration_is_all_that_a_robot_is_made_of(tmp_path):
    mesh = tmp_path / "cube.stl"
    corners = ["0 0 0", "1 0 0", "0 1 0"]
    facet = "".join(f"vertex {corner} " for corner in corners)
    text = f"solid c facet normal 0 0 1 outer loop {facet} endloop endfacet endsolid c"
    mesh.write_text(text)
    model = tmp_path / "arm.urdf"
    model.write_text(
        '<robot name="arm"><link name="base"/><link name="tip"><inertial><mass value="1"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial><visual><geometry>'
        '<mesh filename="cube.stl"/></geometry></visual></link><joint name="j" type="revolute">'
        '<parent link="base"/><child link="tip"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" effort="9" velocity="1"/></joint></robot>'
    )
    before = configuration_hash(str(model), OPTIONS)
    assert configuration_hash(str(model), OPTIONS) == before
    mesh.write_text(text.replace("1 0 0", "2 0 0"))
    assert configuration_hash(str(model), OPTIONS) != before
    assert configuration_hash(str(model), OPTIONS | {"report": "full"}) != before


def test_what_is_unchanged_is_left_alone(made, results, tmp_path, capsys):
    out = shutil.copytree(results, tmp_path / "out")
    tables = [p for p in out.rglob("*.parquet") if COMMON not in p.parts]
    stamps = {p: p.stat().st_mtime_ns for p in tables}
    assert run(made, "--robot", "sara", "--out", out, "--workers", 1) == 3
    assert "3 unchanged" in capsys.readouterr().out
    assert {p: p.stat().st_mtime_ns for p in tables} == stamps
    before = rows(out)
    (out / "b" / "events.json").write_text("[]")
    assert run(made / "b.csv.gz", made / "a", "--robot", "sara", "--out", out) == 0
    assert rows(out)["b"]["outputs"] == before["b"]["outputs"]
    # Another option is another result.
    other = ["--robot", "sara", "--out", out, "--bandwidth", 50]
    assert run(made / "b.csv.gz", made / "a", *other) == 0
    assert rows(out)["b"]["configuration"] != before["b"]["configuration"]


def test_workers_end_in_silence(made, tmp_path, capfd):
    """A thread that lives at the end keeps all that native modules have made."""
    words = (made / "a", made / "b.csv.gz", "--robot", "sara", "--out", tmp_path)
    assert run(*words, "--workers", 2) == 0
    assert capfd.readouterr().err == ""


def test_results_do_not_depend_on_the_processes(made, results, tmp_path):
    plan = make_plan([str(made)], "sara")
    before = rows(results)
    for recording in reversed(plan):
        row = done(Job(recording, tmp_path, before["b"]["configuration"], OPTIONS))
        assert row["outputs"] == before[recording.name]["outputs"]
        assert row["status"] == before[recording.name]["status"]


def test_the_plan_does_nothing(made, tmp_path, capsys):
    assert run(made, "--robot", "sara", "--out", tmp_path / "r", "--dry-run") == 0
    out = capsys.readouterr().out
    assert re.search(r"3 of 6 recordings, [0-9.]+ s and 2 of unknown length", out)
    assert "a/whole  with sara" in out and not (tmp_path / "r").exists()
    for name in ("empty", "foreign", "other"):  # what cannot be read at all is told beforehand
        (line,) = (line for line in out.splitlines() if f"  {name}  (" in line)
        assert line.split()[0] + "ed" == STATUS[name]  # as the run would have it
    assert run(made, "--out", tmp_path / "r", "--dry-run") == 0
    assert "no robot: give --robot" in capsys.readouterr().out


def test_the_plan_tells_hours_and_time(robot, results, tmp_path):
    samples = free_motion(robot, seconds=36.0, rate=200.0)
    for name in ("log.csv", "log.parquet"):
        write_table(tmp_path / name, samples, robot.description)
    plan = make_plan([str(tmp_path / n) for n in ("log.csv", "log.parquet")], "sara")
    told = forecast(plan, tmp_path, "none", 2)
    assert [round(t / 36.0, 2) for t in told.durations.values()] == [1.0, 1.0]
    assert told.measured == 0 and told.seconds == pytest.approx(36.0 * told.cost, rel=0.02)
    measured = forecast(plan, results, "none", 1)  # by what recordings there took
    done = [row for row in rows(results).values() if row["duration"]]
    cost = sum(r["cpu_seconds"] for r in done) / sum(r["duration"] for r in done)
    assert measured.measured == 3 and measured.seconds == pytest.approx(72.0 * cost, rel=0.02)
    lines = forecast_text(told).splitlines()
    assert lines[-2].startswith("2 of 2 recordings, 72 s, ") and "2 processes" in lines[-1]


def test_lists_patterns_and_robots_beside_the_recordings(made, tmp_path):
    plan = {r.name: r for r in make_plan([str(made / "list.csv")], None)}
    assert plan["a/whole"].robot == "sara" and plan["missing"].problem == "no such file"
    names = {"log": ["a/whole.parquet", "missing.csv"], "robot": ["sara", None]}
    pq.write_table(pa.table(names), made / "list.parquet")
    try:
        listed = {r.name: r for r in make_plan([str(made / "list.parquet")], None)}
        assert listed["a/whole"] == plan["a/whole"] and listed["missing"].robot == ""
        assert not is_single([str(made / "list.parquet")])
        assert len(make_plan([str(made)], "sara")) == 6
        pq.write_table(pa.table({"log": ["", "b.csv.gz"]}), made / "list.parquet")
        with pytest.raises(InputError, match="row 1: names no log"):
            make_plan([str(made / "list.parquet")], "sara")
    finally:
        (made / "list.parquet").unlink()
    assert [r.name for r in make_plan([str(made / "*.gz")], "sara")] == ["b", "cut"]
    assert len(make_plan([str(made), str(made / "b.csv.gz")], "sara")) == 6
    with pytest.raises(InputError, match="no such file matches"):
        make_plan([str(made / "*.db3")], "sara")
    copy = shutil.copytree(made, tmp_path / "copy")
    (copy / "robot.yaml").write_text("name: x\nmodel: robot:sara\n")
    (found,) = make_plan([str(copy / "a")], None)
    assert found.robot == str(copy / "robot.yaml")
    assert is_single([str(made / "b.csv.gz")]) and not is_single([str(made)])
    assert not is_single([str(made / "list.csv")]) and not is_single([str(made / "*.gz")])


def test_bad_arguments_and_nothing_done(made, tmp_path, capsys):
    assert run("--robot", "sara", "--out", tmp_path) == 2
    assert run(tmp_path / "none", made, "--robot", "sara", "--out", tmp_path / "r") == 2
    assert run(made, "--robot", "sara", "--out", tmp_path / "r", "--workers", -1) == 2
    assert run(made, "--robot", "sara", "--out", tmp_path / "r", "--time-limit", 0) == 2
    assert "--time-limit" in capsys.readouterr().err
    bad = [made / "foreign.mcap", made / "empty.parquet"]
    assert run(*bad, "--robot", "sara", "--out", tmp_path / "r") == 1
    assert run(made, "--robot", "nobody", "--out", tmp_path / "r") == 1
    assert {row["status"] for row in rows(tmp_path / "r").values()} == {"skipped"}
    with ResultsFolder(tmp_path / "r", ()):
        assert run(made, "--robot", "sara", "--out", tmp_path / "r") == 2


def test_a_manifest_that_was_cut_off_is_read(tmp_path):
    manifest = Manifest(tmp_path)
    manifest.add({"name": "a", "status": "ok"})
    with manifest.path.open("a") as file:
        file.write('{"name": "b", "sta')
    Manifest(tmp_path).add({"name": "c", "status": "ok"})
    assert set(Manifest(tmp_path).rows) == {"a", "c"}


def jobs(made, out, count):
    (recording,) = make_plan([str(made / "a" / "whole.parquet")], "sara")
    return [Job(replace(recording, name=f"n{i}"), out, "", OPTIONS) for i in range(count)]


def test_a_killed_process_costs_a_second_try(made, tmp_path):
    with Pool(2, None, None) as pool:
        todo = jobs(made, tmp_path, 8)
        found = []
        for row in pool.rows(todo):
            found.append(row)
            if len(found) in (1, 3):
                pool._workers[0].process.kill()
        assert sorted(row["name"] for row in found) == sorted(job.recording.name for job in todo)
        assert {row["status"] for row in found} == {"ok"}
        assert len({json.dumps(row["outputs"]) for row in found}) == 1
        left = [worker.process for worker in pool._workers]
    # They end by themselves: killed ones leave semaphores, of which Python complains.
    assert left and all(process.exitcode == 0 for process in left)


def test_limits_of_time_and_memory(made, tmp_path):
    with Pool(1, 0.01, None) as pool:
        (row,) = pool.rows(jobs(made, tmp_path, 1))
    assert row["status"] == "failed" and "took longer than 0.01 s" in row["reason"]


WAITS = """
import sys
from pathlib import Path
from touchline.fleet.plan import Recording
from touchline.fleet.pool import Pool
from touchline.fleet.work import Job

if __name__ == "__main__":
    recording = Recording(Path(sys.argv[1]), "sara", "waits", 0)
    with Pool(1, None, None) as pool:
        list(pool.rows([Job(recording, Path(sys.argv[2]), "", {})]))
"""


def children(process):
    return Path(f"/proc/{process}/task/{process}/children").read_text().split()


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="asks Linux which processes live")
def test_a_worker_amid_its_work_ends_with_a_killed_coordinator(tmp_path):
    """Else it would hold the folder of its recording, which the next run wants."""
    script, log = tmp_path / "waits.py", tmp_path / "waits.csv"
    script.write_text(WAITS)
    os.mkfifo(log)
    coordinator = subprocess.Popen([sys.executable, str(script), str(log), str(tmp_path / "out")])
    late = time.monotonic() + 60.0
    writer = None
    while writer is None:  # until the worker reads, and waits for what never comes
        assert time.monotonic() < late
        try:
            writer = os.open(log, os.O_WRONLY | os.O_NONBLOCK)
        except OSError:
            time.sleep(0.05)
    workers = children(coordinator.pid)
    assert workers
    coordinator.kill()
    coordinator.wait()
    late = time.monotonic() + 20.0
    while any(lives(worker) for worker in workers):
        assert time.monotonic() < late
        time.sleep(0.05)
    os.close(writer)


def _may_be_interrupted():
    """Also where the tests run in the background of a shell, which ignores ^C there."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_a_killed_run_goes_on_where_it_was(made, tmp_path):
    logs, out = tmp_path / "logs", tmp_path / "out"
    logs.mkdir()
    for i in range(24):  # so many that the run still works when it is stopped for the second time
        shutil.copy(made / "a" / "whole.parquet", logs / f"n{i}.parquet")
    command = [sys.executable, "-m", "touchline", "analyze", str(logs), "--robot", "sara"]
    command += ["--out", str(out), "--report", "none", "--workers", "1"]
    environment = os.environ | {"PYTHONPATH": str(Path(tl.__file__).parents[1])}
    for stop in (signal.SIGKILL, signal.SIGINT):
        process = subprocess.Popen(
            command,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            preexec_fn=_may_be_interrupted,  # noqa: PLW1509
        )
        before = len(Manifest(out).rows)
        deadline = time.monotonic() + 120
        while len(Manifest(out).rows) < before + 2 and time.monotonic() < deadline:
            time.sleep(0.02)
        process.send_signal(stop)
        status = process.wait()
        assert status == (-signal.SIGKILL if stop == signal.SIGKILL else 130)
    left = Manifest(out).rows  # of which one may have been in work when the run was stopped
    finished = {n: row["outputs"] for n, row in left.items() if row["status"] == "ok"}
    assert len(finished) >= len(left) - 1 >= 3
    deadline = time.monotonic() + 60  # the killed run's worker ends when its pipe is closed
    while main(command[3:]) == 2 and time.monotonic() < deadline:
        time.sleep(0.5)
    found = rows(out)
    assert [row["status"] for row in found.values()] == ["ok"] * 24
    assert finished.items() <= {n: row["outputs"] for n, row in found.items()}.items()


def test_results_in_python(made, tmp_path):
    results = tl.analyze(made / "a" / "whole.parquet", "sara")
    assert results.estimates.num_rows == 400 and len(results.events) == 1
    (event,) = results.events
    where = event.link or event.segment
    told = f"0: {event.level} at {event.detected:.3f} s on {where}"
    assert repr(results).startswith("<Results: 400 samples, 1 events, ")
    assert repr(results).endswith(f"{told}>")
    assert f"<td>{where}</td>" in results._repr_html_()
    tables = results.to_arrow()
    assert set(tables) == {"estimates", "contacts", "events"}
    assert tables["events"]["segment"].to_pylist() == [event.segment]
    assert all(str(column.type) != "null" for column in tables["events"])
    np.testing.assert_array_equal(np.diff(results.estimates["time"].to_numpy()) > 0, True)
    kept = tl.analyze(made / "a" / "whole.parquet", "sara", tmp_path / "kept")
    assert kept.estimates.equals(results.estimates)
    written = json.loads((tmp_path / "kept" / "events.json").read_text())
    assert [event.as_json() for event in results.events] == written
    loaded = tl.analyze(made / "a" / "whole.parquet", tl.load_robot("sara"), tmp_path / "loaded")
    assert loaded.estimates.equals(results.estimates) and loaded.events == results.events
    origin = json.loads((tmp_path / "loaded" / "analysis.json").read_text())
    assert origin["robot"] == "sara"
    with pytest.raises(InputError):
        tl.analyze(made / "empty.parquet", "sara")
