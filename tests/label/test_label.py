# SPDX-License-Identifier: Apache-2.0
"""The touch channel in data sets for learning: what was felt is there, all else is as it was."""

import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from free_motion import free_motion, pushed

import touchline as tl
from touchline.cli import main
from touchline.errors import InputError
from touchline.label.channel import BEFORE
from touchline.label.lerobot import _numbers, _widths
from touchline.label.naming import Given, choose
from touchline.label.run import label
from touchline.logs import write_table

RATE = 100.0
EPISODES = 3
TOUCH = slice(200, 300)  # of the second episode, at RATE
TOUCHED = 1


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara")


@pytest.fixture(scope="module")
def episodes(robot):
    """Free motion; in one episode the handle is pushed with 40 N for a second."""
    made = [free_motion(robot, seconds=5.0, rate=RATE, seed=seed) for seed in range(EPISODES)]
    made[TOUCHED] = pushed(robot, made[TOUCHED], "handle", TOUCH, [40.0, 0.0, 0.0])
    return made


def vectors(values):
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])


def feature(width, dtype="float32"):
    return {"dtype": dtype, "shape": [width], "names": None}


@pytest.fixture
def lerobot(robot, episodes, tmp_path):
    """A data set as LeRobot v3 writes it: two files, of two episodes and one."""
    folder = tmp_path / "set"
    n, w = len(robot.joint_names), 6 * len(robot.sensor_names)
    features = {
        "observation.state.joint_position": feature(n),
        "observation.state.joint_velocity": feature(n),
        "observation.effort": feature(n),
        "observation.wrench": feature(w),
        "action": feature(n),
    }
    features |= {name: feature(1, "int64") for name in ("episode_index", "frame_index", "index")}
    features |= {"task_index": feature(1, "int64"), "timestamp": feature(1)}
    info = {"codebase_version": "v3.0", "fps": int(RATE), "features": features, "mine": [1, 2]}
    for number, members in enumerate(([0, 1], [2])):
        columns = {}
        for name in ("q", "qd", "tau"):
            values = np.concatenate([getattr(episodes[e], name) for e in members])
            columns[name] = vectors(values.astype(np.float32))
        wrench = np.concatenate([episodes[e].wrench for e in members]).astype(np.float32)
        rows = [len(episodes[e].time) for e in members]
        told = dict(zip(features, columns.values(), strict=False))
        told |= {"observation.wrench": vectors(wrench.reshape(len(wrench), -1))}
        told |= {"action": columns["q"], "episode_index": np.repeat(members, rows)}
        told |= {"frame_index": np.concatenate([np.arange(r) for r in rows])}
        told |= {"index": np.arange(sum(rows)), "task_index": np.zeros(sum(rows), int)}
        stamps = np.concatenate([np.arange(r) / RATE for r in rows]).astype(np.float32)
        path = folder / "data" / "chunk-000" / f"file-{number:03d}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(pa.table(told | {"timestamp": stamps}), path, row_group_size=400)
    (folder / "meta" / "episodes").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    (folder / "meta" / "stats.json").write_text(json.dumps({"action": {"mean": [0.0]}}))
    (folder / "meta" / "episodes" / "notes").write_text("kept")
    (folder / "videos").mkdir()
    (folder / "videos" / "a.mp4").write_bytes(b"film")
    return folder


def read(folder):
    files = sorted((folder / "data").rglob("*.parquet"))
    return pa.concat_tables([pq.read_table(file) for file in files])


def column(table, name, prefix="observation.touch."):
    return np.array(table[prefix + name].to_pylist())


def check_channel(contact, soon, link, force, level, position):
    """What must be felt of the push on the last sensor's segment, wherever it is stored."""
    begin = len(contact) // EPISODES * TOUCHED if len(contact) > 500 else 0
    middle = np.arange(begin + TOUCH.start + 20, begin + TOUCH.stop)
    assert contact[middle].all()
    free = np.ones(len(contact), bool)
    free[begin + TOUCH.start : begin + TOUCH.stop + 50] = False
    assert not contact[free].any()
    np.testing.assert_allclose(np.linalg.norm(force[middle], axis=1), 40.0, rtol=0.1)
    assert not force[~contact].any() and not level[~contact].any() and (level[contact] > 0).all()
    assert (link[~contact] == -1).all() and not position[link < 0].any()
    onset = int(np.flatnonzero(contact)[0])
    expected = np.zeros(len(contact), bool)
    expected[onset - round(BEFORE * RATE) : onset] = True
    np.testing.assert_array_equal(soon[begin : begin + 500], expected[begin : begin + 500])


def test_several_processes_label_the_same(lerobot, tmp_path, robot, capfd):
    told = []
    for workers in (1, 2):
        copy = tmp_path / f"by{workers}"
        done = label(lerobot, robot, copy, Given(), workers)
        files = {p.relative_to(copy): p.read_bytes() for p in copy.rglob("*") if p.is_file()}
        told.append((done, files))
    assert told[0] == told[1] and done.touches >= 1 and done.episodes == EPISODES
    assert "leaked" not in capfd.readouterr().err  # of native objects, as processes end
    spoilt = sorted((lerobot / "data").rglob("*.parquet"))[1]
    spoilt.write_bytes(spoilt.read_bytes()[:-100])
    with pytest.raises(InputError, match="file-001.parquet: not a readable Parquet file"):
        label(lerobot, robot, tmp_path / "spoilt", Given(), 2)
    assert not (tmp_path / "spoilt").exists()


def test_analyze_of_a_data_set_names_the_command_that_is_meant(lerobot, tmp_path, capsys):
    words = ["analyze", str(lerobot), "--robot", "sara", "--out", str(tmp_path / "out")]
    assert main(words) == 2 and not (tmp_path / "out").exists()
    assert f"`touchline label {lerobot} --out COPY`" in capsys.readouterr().err.replace("\n", " ")


def test_lerobot(lerobot, robot, capsys):
    before, files = read(lerobot), {p: p.read_bytes() for p in lerobot.rglob("*") if p.is_file()}
    assert main(["label", str(lerobot), "--robot", "sara"]) == 0
    out = capsys.readouterr().out
    assert "3 episodes, 1500 samples at 100 Hz" in out and "1 touch," in out
    assert "95 % of the pushes are felt from" in out
    after = read(lerobot)
    assert after.select(before.column_names).equals(before)
    groups = pq.ParquetFile(lerobot / "data/chunk-000/file-000.parquet").metadata
    assert [groups.row_group(g).num_rows for g in range(3)] == [400, 400, 200]
    names = ("contact", "soon", "link", "force", "level", "position")
    check_channel(*(column(after, name) for name in names))
    info = json.loads((lerobot / "meta/info.json").read_text())
    old = json.loads(files[lerobot / "meta/info.json"])
    added = {k: v for k, v in info["features"].items() if k.startswith("observation.touch.")}
    assert {k: v for k, v in info["features"].items() if k not in added} == old["features"]
    assert info | {"features": 0} == old | {"features": 0}
    assert set(added) == set(after.column_names) - set(before.column_names)
    for name, entry in added.items():
        width = np.atleast_2d(after[name][0].as_py()).shape[1]
        assert entry["shape"] == [width] and len(entry["names"]) == width
    stats = json.loads((lerobot / "meta/stats.json").read_text())
    assert stats["action"] == {"mean": [0.0]}
    share = column(after, "contact").mean()
    assert stats["observation.touch.contact"]["mean"] == pytest.approx([share])
    about = json.loads((lerobot / "meta/touchline.json").read_text())
    link = column(after, "link")
    assert about["links"][link[link >= 0][0]] in robot.mechanism.links
    for path in ("videos/a.mp4", "meta/episodes/notes"):
        assert (lerobot / path).read_bytes() == files[lerobot / path]
    # Labelled again: the same.
    again = {p: p.read_bytes() for p in lerobot.rglob("*") if p.is_file()}
    assert main(["label", str(lerobot), "--robot", "sara"]) == 0
    assert {p: p.read_bytes() for p in lerobot.rglob("*") if p.is_file()} == again


def test_an_episode_does_not_know_of_others(lerobot, episodes):
    """The third episode reads as one that was felt alone, by a new pipeline."""
    assert main(["label", str(lerobot), "--robot", "sara"]) == 0
    table = read(lerobot)
    rows = np.array(table["episode_index"]) == 2
    s = episodes[2]
    single = [np.float64(np.float32(a)) for a in (s.q, s.qd, s.tau, s.wrench)]
    pipeline = tl.Pipeline("sara", period=1 / RATE)
    stamps = np.float64(np.float32(np.arange(len(s.time)) / RATE))
    estimate, _ = pipeline.run(stamps, *single)
    felt = column(table, "tau_ext")[rows]
    np.testing.assert_array_equal(felt, estimate.tau_ext.astype(np.float32))


def test_a_copy_leaves_the_data_set_alone(lerobot, tmp_path):
    before = {p: p.read_bytes() for p in lerobot.rglob("*") if p.is_file()}
    out = tmp_path / "labelled"
    assert main(["label", str(lerobot), "--robot", "sara", "--out", str(out)]) == 0
    assert {p: p.read_bytes() for p in lerobot.rglob("*") if p.is_file()} == before
    assert "observation.touch.force" in read(out).column_names
    assert main(["label", str(lerobot), "--robot", "sara", "--out", str(out)]) == 2


def test_a_damaged_copy_is_none(lerobot, tmp_path, capsys):
    file = lerobot / "data/chunk-000/file-001.parquet"
    file.write_bytes(file.read_bytes()[:-9])
    out = tmp_path / "labelled"
    assert main(["label", str(lerobot), "--robot", "sara", "--out", str(out)]) == 2
    assert str(file) in capsys.readouterr().err  # in the user's words, not the copy's
    assert not out.exists() and not (tmp_path / ".part.labelled").exists()


def edit(folder, **changes):
    path = folder / "meta/info.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def test_what_cannot_be_used_is_told(lerobot, tmp_path, capsys):
    def told(*arguments):
        assert main(["label", *map(str, arguments), "--robot", "sara"]) == 2
        return capsys.readouterr().err

    assert "no such array" in told(lerobot, "--tau", "effort")
    assert "numbers, but" in told(lerobot, "--tau", "observation.wrench")
    assert "--rate -1" in told(lerobot, "--rate", -1)
    edit(lerobot, fps=0)
    assert "fps is 0" in told(lerobot)
    edit(lerobot, codebase_version="v2.1")
    assert "v3.x is needed" in told(lerobot)
    assert "no such file" in told(tmp_path / "none")
    (tmp_path / "a.txt").write_text("x")
    assert "must be a LeRobot data set" in told(tmp_path / "a.txt")
    one = shutil.copy(next((lerobot / "data").rglob("*.parquet")), tmp_path)
    assert "name the folder that holds meta/info.json" in told(one)
    (tmp_path / "empty").mkdir()
    assert "neither a LeRobot data set" in told(tmp_path / "empty")


@pytest.mark.parametrize("part", ["meta", "data", "data/chunk-000/file-000.parquet"])
def test_a_part_of_a_data_set_names_the_whole(lerobot, robot, part):
    before = {path: path.read_bytes() for path in lerobot.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match=f"a part of the LeRobot data set {lerobot}; name that"):
        label(lerobot / part, robot, None, Given())
    assert before == {path: path.read_bytes() for path in before}


def test_plain_parquet(robot, episodes, tmp_path):
    path = tmp_path / "log.parquet"
    write_table(path, episodes[TOUCHED], robot.description)
    before = pq.read_table(path)
    assert main(["label", str(path), "--robot", "sara"]) == 0
    after = pq.read_table(path)
    assert after.select(before.column_names).equals(before)
    contact = column(after, "contact", "touch.")
    assert contact[TOUCH][20:].all() and not contact[: TOUCH.start].any()
    links = {word for word in after["touch.link"].to_pylist() if word}
    assert links and links <= set(robot.mechanism.links)
    assert set(after["touch.level"].to_pylist()) <= {"none", "contact", "collision"}
    assert f"touch.tau_ext.{robot.joint_names[0]}" in after.column_names


def test_a_folder_of_files_is_labelled_file_by_file(robot, episodes, tmp_path, capsys):
    folder = tmp_path / "data"
    for number, name in enumerate(("a", "b/c")):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        write_table(folder / f"{name}.parquet", episodes[number], robot.description)
    (folder / "notes.txt").write_text("no data")
    assert main(["label", str(folder), "--robot", "sara"]) == 0
    assert "2 episodes, 1000 samples at 100 Hz" in capsys.readouterr().out
    free, touched = (
        column(pq.read_table(folder / f"{name}.parquet"), "contact", "touch.")
        for name in ("a", "b/c")
    )
    assert touched[TOUCH][20:].all() and not free.any()


@pytest.mark.parametrize(
    ("name", "words"),
    [("empty", "neither a LeRobot data set nor HDF5"), ("log.csv", "must be a LeRobot data set")],
)
def test_what_is_no_data_set_is_told(tmp_path, capsys, name, words):
    path = tmp_path / name
    path.write_text("x") if path.suffix else path.mkdir()
    assert main(["label", str(path), "--robot", "sara"]) == 2
    assert words in capsys.readouterr().err


def test_arrays_without_positions_or_torques_are_told(robot, tmp_path):
    with pytest.raises(InputError, match="no 7 joint positions found; name them by --q"):
        choose(tmp_path, Given(), {"action": 3}, robot.description)
    with pytest.raises(InputError, match="--tau torque: 6 numbers, but 7 are needed"):
        choose(tmp_path, Given(q="q", tau="torque"), {"q": 7, "torque": 6}, robot.description)
    with pytest.raises(InputError, match="without them nothing can be felt"):
        choose(tmp_path, Given(q="q"), {"q": 7}, robot.description)


def test_a_column_that_is_damaged_and_no_signal_is_told(robot, episodes, tmp_path, capsys):
    path = tmp_path / "log.parquet"
    write_table(path, episodes[TOUCHED], robot.description)
    table = pq.read_table(path)
    table = table.append_column("note", [[f"note {i}" * 3 for i in range(len(table))]])
    pq.write_table(table, path, use_dictionary=False)
    chunk = pq.ParquetFile(path).metadata.row_group(0).column(table.num_columns - 1)
    raw = bytearray(path.read_bytes())
    middle = chunk.data_page_offset + chunk.total_compressed_size // 2
    raw[middle : middle + 64] = bytes(64)
    path.write_bytes(raw)
    assert main(["label", str(path), "--robot", "sara"]) == 2
    assert "log.parquet: damaged" in capsys.readouterr().err
    assert path.read_bytes() == bytes(raw)


@pytest.mark.parametrize("layout", ["droid", "robomimic"])
def test_hdf5(robot, episodes, tmp_path, layout):
    h5py = pytest.importorskip("h5py", reason="h5py is not installed: touchline[hdf5]")
    path, s = tmp_path / "trajectory.h5", episodes[TOUCHED]
    place = "observation/robot_state" if layout == "droid" else "data/demo_0/obs"
    torques = "motor_torques_measured" if layout == "droid" else "joint_torques"
    group = "observation/touch" if layout == "droid" else "data/demo_0/obs/touch"
    wrench = "observation/w" if layout == "droid" else "data/demo_0/obs/w"
    with h5py.File(path, "w") as file:
        file[f"{place}/joint_positions"], file[f"{place}/{torques}"] = s.q, s.tau
        file[f"{place}/joint_velocities"] = s.qd
        file[wrench] = s.wrench.reshape(len(s.time), -1)
        file.attrs["mine"] = "kept"
        if layout == "droid":
            file["observation/timestamp/robot_state/read_start"] = (5e12 + 1e3 * s.time).astype(int)
    own = ["--wrench", wrench.removeprefix("data/demo_0/")]
    own += [] if layout == "droid" else ["--rate", str(RATE)]
    for _ in range(2):
        assert main(["label", str(path), "--robot", "sara", *own]) == 0
        with h5py.File(path) as file:
            told = {name: file[f"{group}/{name}"][:] for name in file[group]}
            assert file.attrs["mine"] == "kept"
            np.testing.assert_array_equal(file[f"{place}/{torques}"][:], s.tau)
        names = ("contact", "soon", "link", "force", "level", "position")
        check_channel(*(told[name] for name in names))
    if layout == "robomimic":
        assert main(["label", str(path), "--robot", "sara", *own[:2]]) == 2


def test_damaged_hdf5_is_refused_in_one_line_and_stays_as_it_was(episodes, tmp_path, capsys):
    h5py = pytest.importorskip("h5py", reason="h5py is not installed: touchline[hdf5]")
    path, s = tmp_path / "trajectory.h5", episodes[TOUCHED]
    with h5py.File(path, "w") as file:
        file["obs/joint_positions"], file["obs/joint_torques"] = s.q, s.tau
        file["obs/joint_velocities"], file["obs/wrench"] = s.qd, s.wrench.reshape(len(s.q), -1)
    whole = path.read_bytes()
    command = ["label", str(path), "--robot", "sara", "--rate", str(RATE)]
    assert main(command) == 0
    for name in (b"joint_positions", b"joint_torques", b"TREE", b"SNOD", b"HEAP"):
        damaged = whole.replace(name, name[::-1])
        assert damaged != whole
        path.write_bytes(damaged)
        assert main(command) == 2
        assert path.read_bytes() == damaged and list(tmp_path.iterdir()) == [path]
        assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_hdf5_that_claims_more_than_it_holds_is_refused_unread(robot, tmp_path, capsys):
    h5py = pytest.importorskip("h5py", reason="h5py is not installed: touchline[hdf5]")
    path, n = tmp_path / "trajectory.h5", len(robot.joint_names)
    with h5py.File(path, "w") as file:
        for name in ("joint_positions", "joint_velocities", "joint_torques"):
            file.create_dataset(f"obs/{name}", (10**10, n), "f8", chunks=(1000, n))
    assert main(["label", str(path), "--robot", "sara", "--rate", str(RATE)]) == 2
    assert "claims 560000 MB and holds 0.0" in capsys.readouterr().err


CREATE = """
import sys
import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset
folder, source, rate = sys.argv[1:]
names = ("observation.effort", "observation.wrench", "observation.state.joint_position",
         "observation.state.joint_velocity", "action")
told = np.load(source)
shapes = {name: told[name].shape[-1:] for name in names}
features = {n: {"dtype": "float32", "shape": s, "names": None} for n, s in shapes.items()}
made = LeRobotDataset.create(
    "local/set", int(float(rate)), features, root=folder, robot_type="sara", use_videos=False
)
for episode in range(len(told["action"])):
    for row in range(told["action"].shape[1]):
        made.add_frame({name: told[name][episode, row] for name in names} | {"task": "t"})
    made.save_episode()
made.finalize()
"""
OPEN = """
import sys, json
from lerobot.datasets.lerobot_dataset import LeRobotDataset
opened = LeRobotDataset("local/set", root=sys.argv[1])
frame = opened[int(sys.argv[2])]
told = {n: v.tolist() for n, v in frame.items() if n.startswith("observation.touch.")}
shapes = {n: list(f["shape"]) for n, f in opened.features.items() if n in told}
action = frame["action"].tolist()
print(json.dumps([opened.num_episodes, len(opened), told, shapes, action]))
"""
WINDOWS = """
import sys, json
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset
times = json.loads(sys.argv[2])
names = ["observation.touch.force", "observation.touch.contact", "observation.touch.soon"]
opened = LeRobotDataset("local/set", root=sys.argv[1], delta_timestamps=dict.fromkeys(names, times))
indices = json.loads(sys.argv[3])
loader = torch.utils.data.DataLoader(torch.utils.data.Subset(opened, indices), len(indices))
batch = next(iter(loader))
print(json.dumps({n: batch[n].tolist() for n in names + [n + "_is_pad" for n in names]}))
"""


def lerobot_python():
    """A Python that has lerobot, which wants other versions than Touchline's: the environment's."""
    python = os.environ.get("TOUCHLINE_LEROBOT_PYTHON", sys.executable)
    code = "import lerobot.datasets.lerobot_dataset"
    if subprocess.run([python, "-c", code], check=False, capture_output=True).returncode:
        pytest.skip("lerobot is absent: TOUCHLINE_LEROBOT_PYTHON names no Python that has it")
    return python


def test_lerobots_own_loader(robot, episodes, tmp_path):
    python, folder = lerobot_python(), tmp_path / "set"
    signals = {"q": "observation.state.joint_position", "qd": "observation.state.joint_velocity"}
    signals |= {"tau": "observation.effort", "wrench": "observation.wrench"}
    told = {name: np.array([getattr(e, key) for e in episodes]) for key, name in signals.items()}
    told = {name: v.reshape(*v.shape[:2], -1).astype(np.float32) for name, v in told.items()}
    told["action"] = told[signals["q"]] + 1.0
    np.savez(tmp_path / "told.npz", **told)

    def run(code, *arguments):
        command = [python, "-c", code, str(folder), *map(str, arguments)]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    run(CREATE, tmp_path / "told.npz", RATE)
    assert main(["label", str(folder), "--robot", "sara"]) == 0
    table = read(folder)
    for index in (100, 500 * TOUCHED + TOUCH.stop - 10):
        count, frames, touch, shapes, action = json.loads(run(OPEN, index).splitlines()[-1])
        assert (count, frames) == (EPISODES, 500 * EPISODES)
        assert shapes["observation.touch.force"] == [3] and "observation.touch.contact" in shapes
        np.testing.assert_array_equal(action, told["action"].reshape(frames, -1)[index])
        for name, values in touch.items():
            np.testing.assert_array_equal(
                np.ravel(values), np.ravel(column(table, name, "")[index])
            )

    # Windows about a frame, batched for training: those of one episode, padded at its ends.
    steps, indices = np.array([-40, 0, 40]), [30, 500 * TOUCHED + TOUCH.start, 500 * EPISODES - 1]
    batch = json.loads(run(WINDOWS, (steps / RATE).tolist(), indices).splitlines()[-1])
    wanted = np.array(indices)[:, None] + steps
    first = np.array(indices)[:, None] // 500 * 500
    held = np.clip(wanted, first, first + 499)  # of an episode
    for name in [name for name in batch if not name.endswith("_is_pad")]:
        values = column(table, name, "")[held]
        np.testing.assert_array_equal(np.squeeze(batch[name]), values)
        np.testing.assert_array_equal(batch[f"{name}_is_pad"], wanted != held)
        assert values.any() and not values.all()


@pytest.mark.skipif(os.name != "posix", reason="asks for the permissions of POSIX")
def test_a_write_protected_data_set(lerobot, robot, tmp_path):
    """It is labelled as a copy; in place all is refused before the first file is replaced."""
    files = {p: p.read_bytes() for p in lerobot.rglob("*") if p.is_file()}
    for path in (lerobot, *lerobot.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    try:
        assert label(lerobot, robot, tmp_path / "copy", Given()).episodes == EPISODES
        assert label(tmp_path / "copy", robot, None, Given()).episodes == EPISODES
    finally:
        for path in (lerobot, *lerobot.rglob("*")):
            path.chmod(0o755 if path.is_dir() else 0o644)
    (tmp_path / ".part.other").mkdir()
    with pytest.raises(InputError, match=r"\.part\.other: left by a run"):
        label(lerobot, robot, tmp_path / "other", Given())
    last = max((lerobot / "data").rglob("*.parquet"))
    last.with_name(f".part.{last.name}").mkdir()  # nothing can be written in its place
    with pytest.raises(InputError, match=rf"{last.name}: cannot be written"):
        label(lerobot, robot, None, Given())
    assert all(path.read_bytes() == content for path, content in files.items())


def test_a_copy_of_another_kind_is_refused(tmp_path, capsys):
    table = tmp_path / "a.parquet"
    table.write_bytes(b"")
    words = ["label", str(table), "--robot", "sara", "--out", str(tmp_path / "b.csv")]
    assert main(words) == 2
    assert "b.csv: must end in '.parquet'" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [table]


@pytest.mark.parametrize("shape", [[float("inf")], [1.5], ["1"], 3, [2, 2], None])
def test_a_feature_whose_shape_is_no_row_is_no_signal(shape):
    features = {"odd": {"dtype": "float32", "shape": shape}}
    features["row"] = {"dtype": "float32", "shape": [7]}
    assert _widths(features) == {"row": 7}


def test_a_column_that_holds_no_numbers_is_refused_in_words():
    column = pa.chunked_array([pa.array([{"list": [1.0]}, {"list": [2.0]}])])
    with pytest.raises(InputError, match="here: holds struct.*, not lists of numbers"):
        _numbers(column, "here")
