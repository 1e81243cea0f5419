# SPDX-License-Identifier: Apache-2.0
"""Whatever is wrong with an input: exit status 2 and one clear message, or a health bit."""

import gzip
import importlib
import os
import re
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from free_motion import free_motion, pushed

import touchline as tl
from touchline.cli import main
from touchline.folder import UNFINISHED
from touchline.logs import write_table
from touchline.logs.truth import read_truth

main_module = importlib.import_module("touchline.cli.main")  # `touchline.cli.main` is its function


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara")


@pytest.fixture(scope="module")
def samples(robot):
    return free_motion(robot, seconds=3.0, rate=200.0)


@pytest.fixture
def log(tmp_path, robot, samples):
    path = tmp_path / "log.parquet"
    write_table(path, samples, robot.description)
    return path


def analyze(log, out, *options, robot="sara"):
    return main(["analyze", str(log), "--robot", str(robot), "--out", str(out), *options])


def refused(capsys, log, out, *options, robot="sara"):
    """The message on stderr of an analysis that must be refused."""
    assert analyze(log, out, *options, robot=robot) == 2
    message = capsys.readouterr().err
    assert message.strip() and "Traceback" not in message
    return message


def described(tmp_path, extra="", model="robot:sara", joints=""):
    path = tmp_path / "robot.yaml"
    path.write_text(f"name: mine\nmodel: {model}\n{joints}{extra}")
    return path


def without(path, *columns):
    table = pq.read_table(path)
    pq.write_table(table.drop_columns(list(columns)), path)


def test_no_such_log(capsys, tmp_path):
    assert "nothing.csv: no such file" in refused(capsys, tmp_path / "nothing.csv", tmp_path / "r")


def test_no_such_robot(capsys, log, tmp_path):
    message = refused(capsys, log, tmp_path / "r", robot="sarah")
    assert "sarah" in message and "sara" in message
    assert "no such file" in refused(capsys, log, tmp_path / "r", robot=tmp_path / "x.yaml")


def test_every_error_of_a_description_at_once(capsys, log, tmp_path):
    path = described(tmp_path, "gravitty: [0, 0, -9.81]\nobserver: {bandwidth: -3}\n")
    message = refused(capsys, log, tmp_path / "r", robot=path)
    assert "gravitty" in message and "did you mean 'gravity'" in message and "bandwidth" in message


def test_unknown_joint(capsys, log, tmp_path):
    path = described(tmp_path, joints="joints:\n  - {name: joint9}\n")
    message = refused(capsys, log, tmp_path / "r", robot=path)
    assert "joint9" in message and "joint1" in message


def test_description_that_is_no_yaml(capsys, log, tmp_path):
    path = described(tmp_path, "joints: [}")
    assert "robot.yaml:3" in refused(capsys, log, tmp_path / "r", robot=path)


def test_log_without_torques(capsys, log, tmp_path):
    names = [f"tau.joint{i}" for i in (2, 3, 4, 5)]
    without(log, *names)
    message = refused(capsys, log, tmp_path / "r")
    assert "log.parquet" in message and "no joint torques" in message


def test_missing_and_misspelt_columns(capsys, log, tmp_path):
    table = pq.read_table(log)
    names = ["wrist.Fx" if name == "wrist.fx" else name for name in table.column_names]
    pq.write_table(table.rename_columns(names).drop_columns(["q.joint4"]), log)
    message = refused(capsys, log, tmp_path / "r")
    assert "'wrist.fx'" in message and "did you mean 'wrist.Fx'" in message
    assert "'q.joint4'" in message, message


@pytest.mark.parametrize("name", ["log.parquet", "log.csv", "log.csv.gz", "log.db3", "log.mcap"])
def test_empty_file(capsys, tmp_path, name):
    path = tmp_path / name
    path.write_bytes(b"")
    message = refused(capsys, path, tmp_path / "r")
    assert name in message and "empty" in message


def test_table_without_rows(capsys, log, tmp_path):
    pq.write_table(pq.read_table(log).slice(0, 0), log)
    assert "log.parquet: " in refused(capsys, log, tmp_path / "r")


@pytest.mark.parametrize("name", ["log.parquet", "log.db3", "log.mcap", "log.csv.gz"])
def test_file_of_another_kind(capsys, tmp_path, name):
    path = tmp_path / name
    path.write_bytes(bytes(range(256)) * 64)
    assert name in refused(capsys, path, tmp_path / "r")


def test_unknown_kind_of_log(capsys, tmp_path):
    path = tmp_path / "log.xlsx"
    path.write_bytes(b"x" * 100)
    message = refused(capsys, path, tmp_path / "r")
    assert ".parquet" in message and ".mcap" in message


def test_truncated_parquet(capsys, log, tmp_path):
    log.write_bytes(log.read_bytes()[:-2000])
    assert "log.parquet" in refused(capsys, log, tmp_path / "r")


def test_word_in_a_column_of_numbers(capsys, robot, samples, tmp_path):
    path = tmp_path / "log.csv"
    write_table(path, samples, robot.description)
    lines = path.read_text().splitlines()
    column = lines[0].split(",").index("tau.joint3")
    cells = lines[101].split(",")
    cells[column] = "oops"
    lines[101] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")
    message = refused(capsys, path, tmp_path / "r")
    assert "oops" in message and "tau.joint3" in message and "log.csv" in message


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--bandwidth", "-5"], "-5"),
        (["--bandwidth", "nan"], "nan"),
        (["--bandwidth", "fast"], "fast"),
        (["--method", "magic"], "magic"),
        (["--colour", "red"], "--colour"),
    ],
)
def test_bad_options(capsys, log, tmp_path, options, words):
    assert words in refused(capsys, log, tmp_path / "r", *options)


def test_missing_options(capsys):
    assert main(["analyze", "log.csv"]) == 2
    assert "--out" in capsys.readouterr().err
    assert main(["analyze", "log.csv", "--out", "r"]) == 2
    assert "--robot" in capsys.readouterr().err


def test_unknown_command(capsys):
    assert main(["analize"]) == 2
    assert "did you mean 'analyze'" in capsys.readouterr().err


def test_out_is_a_file(capsys, log, tmp_path):
    (tmp_path / "r").write_text("precious")
    assert "is a file" in refused(capsys, log, tmp_path / "r")
    assert (tmp_path / "r").read_text() == "precious"


def test_results_never_replace_an_input(capsys, robot, samples, tmp_path):
    path = tmp_path / "estimates.parquet"
    write_table(path, samples, robot.description)
    before = path.read_bytes()
    assert "would be replaced by the results" in refused(capsys, path, tmp_path)
    with pytest.raises(tl.InputError, match="would be replaced"):
        tl.analyze(path, "sara", tmp_path)
    assert path.read_bytes() == before


def test_old_results_stay_when_the_input_is_refused(capsys, log, tmp_path):
    out = tmp_path / "r"
    assert analyze(log, out) == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    refused(capsys, tmp_path / "nothing.csv", out)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def estimates(out):
    return pq.read_table(out / "estimates.parquet")


def test_bad_samples_get_a_health_bit_and_harm_no_others(robot, samples, tmp_path):
    tau, wrench, qd = samples.tau.copy(), samples.wrench.copy(), samples.qd.copy()
    tau[100, 2] = np.inf
    wrench[200:260, 1] = np.nan  # the wrist sensor is gone for 0.3 s
    qd[400, 0] = np.nan
    time = samples.time.copy()
    time[150] = time[149]
    time[350] = time[340]
    time[450:] += 1.0
    bad = replace(samples, tau=tau, wrench=wrench, qd=qd, time=time)
    write_table(tmp_path / "log.parquet", bad, robot.description)
    assert analyze(tmp_path / "log.parquet", tmp_path / "r") == 0
    health = np.array(estimates(tmp_path / "r")["health"])
    bits = tl.Health
    assert health[100] & bits.NON_FINITE and health[400] & bits.MISSING
    assert health[150] & bits.BAD_TIME and health[350] & bits.BAD_TIME
    assert health[450] & bits.GAP
    assert (health[201:260] & bits.MISSING).all() and health[259] & bits.SENSOR_EXCLUDED
    assert (health[20:100] == 0).all()
    base = np.array(estimates(tmp_path / "r")["base.ext.fx"])
    assert np.isfinite(base[200:260]).all() and np.abs(base[200:260]).max() < 0.1


def test_missing_and_unreadable_meshes_only_cost_the_location(capsys, log, tmp_path, robot):
    text = robot.description.model.read_text()
    folder = tmp_path / "meshes"
    folder.mkdir()
    (folder / "link1.stl").write_bytes(b"this is no mesh")
    (tmp_path / "arm.urdf").write_text(text)
    joints = robot.description.path.read_text().partition("joints:")[2]
    path = described(tmp_path, model="arm.urdf", joints=f"joints:{joints}")
    assert analyze(log, tmp_path / "r", robot=path) == 0
    out = capsys.readouterr().out
    assert "link2" in out and "no contact is located" in out


def test_urdf_that_is_no_xml(capsys, log, tmp_path):
    (tmp_path / "arm.urdf").write_text("<robot name='x'><link name='a'>")
    path = described(tmp_path, model="arm.urdf")
    assert "arm.urdf" in refused(capsys, log, tmp_path / "r", robot=path)


def test_massless_moving_link_is_named(capsys, log, tmp_path):
    zero = "links:\n  tool: {mass: 0.0}\n"
    path = described(tmp_path, zero, joints="")
    main(["check", str(path)])
    assert "tool" in capsys.readouterr().out


def test_truncated_stream_leaves_what_was_read(capsys, robot, tmp_path, monkeypatch):
    monkeypatch.setattr("touchline.report.analysis.CHUNK", 500)
    long = free_motion(robot, seconds=30.0, rate=200.0)
    path = tmp_path / "log.csv.gz"
    write_table(path, long, robot.description)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    status = analyze(path, tmp_path / "r")
    captured = capsys.readouterr()
    assert status in (0, 2) and "log.csv.gz" in captured.err + captured.out
    folder = tmp_path / "r"
    table = (
        estimates(folder) if status == 0 else pq.read_table(folder / UNFINISHED / "estimates.parts")
    )
    assert 1000 < table.num_rows < 6000
    assert isinstance(table, pa.Table)


SLOW = """
import sys, time
import touchline.logs.writer as writer
import touchline.report.analysis as analysis
from touchline.cli import main
writer.PART_ROWS, analysis.CHUNK = 500, 250
add, count = analysis._Run.add, [0]
def slow(self, part):
    felt = add(self, part)
    count[0] += 1
    if count[0] == 9:
        print("nine parts", flush=True)
        time.sleep(60)
    return felt
analysis._Run.add = slow
sys.exit(main(sys.argv[1:]))
"""


def test_a_killed_run_leaves_what_it_had_finished(robot, tmp_path):
    samples = free_motion(robot, seconds=15.0, rate=200.0)
    samples = pushed(robot, samples, "link0", slice(1000, 1100), [30.0, 0.0, 0.0])
    log, out = tmp_path / "log.parquet", tmp_path / "r"
    write_table(log, samples, robot.description)
    arguments = ["analyze", str(log), "--robot", "sara", "--out", str(out)]
    process = subprocess.Popen(
        [sys.executable, "-c", SLOW, *arguments], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "nine parts\n"
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert [p.name for p in out.iterdir()] == [UNFINISHED]
    table = pq.read_table(out / UNFINISHED / "estimates.parts")
    np.testing.assert_array_equal(table["time"], samples.time[:2000])
    text = (out / UNFINISHED / "events.json").read_text()
    assert '"segment": "base"' in text and "NaN" not in text
    assert main(arguments) == 0  # and the next run clears up
    assert not (out / UNFINISHED).exists()
    assert pq.read_table(out / "estimates.parquet").num_rows == 3000


def test_no_traceback_from_a_process(tmp_path):
    process = subprocess.run(
        [sys.executable, "-m", "touchline", "analyze", "x.csv", "--robot", "sara", "--out", "r"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(tl.__file__).parents[1])},
        check=False,
    )
    assert process.returncode == 2
    assert process.stderr == "touchline: x.csv: no such file\n"
    assert not (tmp_path / "r").exists()


def test_a_missing_extra_is_named(capsys, log, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    assert analyze(log, tmp_path / "r") == 1
    assert "touchline[logs]" in capsys.readouterr().err


def test_gzip_that_is_none(capsys, tmp_path):
    path = tmp_path / "log.csv.gz"
    path.write_bytes(gzip.compress(b"time,a\n0,1\n")[:10])
    assert "log.csv.gz" in refused(capsys, path, tmp_path / "r")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            "localisation",
            "benchmark 'localisation'; there are: .*did you mean 'localization'",
        ),
        ("--runs 3", "--runs: options belong to one benchmark"),
        ("observer wrench --seed 1", "--seed: options belong to one benchmark"),
        ("observer --rounds 0", "--rounds 0: must be at least 1"),
        ("localization --runs 0", "--runs 0: must be at least 1"),
        ("localization --seed -1", "--seed -1: must be at least 0"),
        ("localization --speeds 1 -2", "--speeds -2: must be at least 0"),
        ("classification --interactions -5", "--interactions -5: must be at least 1"),
        ("reaction --encounters 0", "--encounters 0: must be at least 1"),
        ("reaction --guiding nan", "--guiding nan: must be at least 0"),
        ("wrench --seed -1", "--seed -1: must be at least 0"),
        ("detection --hours -1", "--hours -1: must be at least 0.1"),
        ("detection --hours inf", "--hours inf: must be at least 0.1"),
        ("detection --pushes 0", "--pushes 0: must be at least 1"),
        ("detection --rates", "nothing to run"),
        ("detection --velocity-noise 0.5", "velocity noise 0.5 rad/s; allowed: 0.001, 0.0002"),
    ],
)
def test_a_benchmark_is_told_what_it_cannot_do(arguments, message, capsys):
    assert main(["bench", *arguments.split()]) == 2
    assert re.search(message, capsys.readouterr().err)


@pytest.mark.parametrize("name", ["log.csv", "log.parquet"])
def test_a_folder_that_is_called_like_a_table(capsys, tmp_path, name):
    (tmp_path / name).mkdir()
    assert "no recordings there" in refused(capsys, tmp_path / name, tmp_path / "r")


def test_a_name_that_no_file_can_have(capsys, log, tmp_path):
    name = "x" * 300
    for arguments in (
        ["analyze", f"{name}.csv", "--robot", "sara", "--out", str(tmp_path / "r")],
        ["analyze", str(log), "--robot", "sara", "--out", str(tmp_path / name)],
        ["check", name],
    ):
        assert main(arguments) == 2
        assert "File name too long" in capsys.readouterr().err


@pytest.mark.parametrize(
    "command",
    [
        ["simulate", "three_touches", "--out", "x.parquet"],
        ["demo", "--no-browser", "--duration", "1"],
        ["demo", "--headless", "--duration", "4"],
        ["reproduce", "fig4", "--out", "x"],
    ],
)
def test_a_seed_is_not_negative(capsys, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    assert main([*command, "--seed", "-1"]) == 2
    assert "--seed -1: must be at least 0" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_port_is_a_port(capsys):
    for port in ("-1", "65536"):
        assert main(["demo", "--no-browser", "--duration", "1", "--port", port]) == 2
        assert "must be from 0 to 65535" in capsys.readouterr().err


def test_more_than_memory_holds(capsys, tmp_path):
    out = ["--out", str(tmp_path / "x.parquet")]
    assert main(["simulate", "free_motion", *out, "--seconds", "1e9"]) == 1
    assert "not enough memory" in capsys.readouterr().err


def test_readings_beyond_all_reason(capsys, log):
    table = pq.read_table(log)
    for name in table.column_names:
        if name != "time":
            huge = pa.array(1e300 * np.array(table.column(name)))
            table = table.set_column(table.column_names.index(name), name, huge)
    pq.write_table(table, log)
    assert main(["check", "sara", str(log)]) == 1
    assert "findings:" in capsys.readouterr().out


def with_truth(path, links, metadata):
    """Adds a true contact in every sample; `links` are the numbers of what it touches."""
    table = pq.read_table(path)
    for part in ("x", "y", "z", "fx", "fy", "fz"):
        table = table.append_column(f"truth.contact.0.{part}", pa.array(np.ones(len(table))))
    table = table.append_column("truth.contact.0.link", pa.array(np.full(len(table), links)))
    pq.write_table(table.replace_schema_metadata(metadata), path)


@pytest.mark.parametrize(
    ("links", "metadata"),
    [(99, {"a": '{"truth.links": ["link1"]}'}), (np.inf, None), (0, None), (0, {"author": "me"})],
)
def test_a_truth_that_cannot_be_read_is_none(log, tmp_path, links, metadata):
    with_truth(log, links, metadata)
    assert analyze(log, tmp_path / "r") == 0


def test_a_truth_beside_what_others_left_is_read(log):
    with_truth(log, 0, {"author": "me", "robot": '{"truth.links": ["link1"]}'})
    assert [contact.link for contact in read_truth(log)] == ["link1"]


@pytest.mark.parametrize(
    "command",
    [
        "view {absent}",
        "calibrate --plan sara --out {file}",
        "demo --headless --out {file}",
        "live --robot sara --source sim:// --record {file}/a.parquet",
        "label {log} --robot sara --out {file}/a.parquet",
    ],
)
def test_what_cannot_be_read_or_written_is_told_before_the_work(command, tmp_path, log, capsys):
    file = tmp_path / "text.txt"
    file.write_text("hello")
    names = {"absent": tmp_path / "absent", "file": file, "log": log}
    assert main([word.format(**names) for word in command.split()]) == 2
    told = capsys.readouterr()
    (line,) = told.err.splitlines()
    assert str(tmp_path) in line and told.out == ""


def test_a_file_of_another_kind_is_told_in_one_line(tmp_path, capsys):
    path = tmp_path / "a.csv"
    path.write_text("a,b\n1,2\n")
    assert main(["check", "sara", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "columns are missing" in line and "columns present: a, b" in line


@pytest.mark.parametrize(
    ("error", "status", "words"),
    [
        (KeyboardInterrupt(), 130, "stopped"),
        (OSError(28, "No space left on device"), 1, "No space left on device"),
        (FileNotFoundError(2, "No such file or directory", "x.yaml"), 2, "x.yaml: No such file"),
        (ModuleNotFoundError("no", name="matplotlib"), 1, "touchline[report]"),
    ],
)
def test_what_ends_a_command_is_one_line(monkeypatch, capsys, error, status, words):
    def fails():
        raise error

    monkeypatch.setitem(main_module.COMMANDS, "check", fails)
    assert main(["check"]) == status
    assert words in capsys.readouterr().err


def test_a_package_that_is_not_ours_to_name_is_a_traceback(monkeypatch):
    def fails():
        raise ModuleNotFoundError("no", name="touchline_of_mine")

    monkeypatch.setitem(main_module.COMMANDS, "check", fails)
    with pytest.raises(ModuleNotFoundError):
        main(["check"])


def test_a_reader_that_has_seen_enough_is_no_error(monkeypatch):
    def fails():
        raise BrokenPipeError

    monkeypatch.setitem(main_module.COMMANDS, "check", fails)
    monkeypatch.setattr(sys, "stdout", sys.stdout)  # it is given back after the test
    assert main(["check"]) == 0
    assert sys.stdout is None


def test_benchmarks_run_one_after_the_other_and_options_belong_to_one(monkeypatch, capsys):
    ran = []

    def noted(name):
        def run() -> int:
            ran.append(name)
            return int(name == "logs")

        return run

    for name in main_module.BENCHMARKS:
        monkeypatch.setitem(main_module.BENCHMARKS, name, noted(name))
    assert main(["bench", "observer", "logs"]) == 1 and ran == ["observer", "logs"]
    assert main(["bench", "observer", "logs", "--rounds", "3"]) == 2
    assert "options belong to one benchmark" in capsys.readouterr().err
    assert main(["bench", "observe"]) == 2
    assert "did you mean 'observer'" in capsys.readouterr().err
    ran.clear()
    assert main(["bench"]) == 1
    assert "touchline bench real --data DIR" in capsys.readouterr().out
    assert set(ran) >= set(main_module.BENCHMARKS) - {"real"}


def test_the_version_is_that_of_the_package(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"touchline {tl.__version__}\n"
