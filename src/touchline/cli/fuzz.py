# SPDX-License-Identifier: Apache-2.0
"""`touchline bench fuzz`: damaged input for each parser; prints what is not refused in words."""

import contextlib
import csv
import gzip
import io
import json
import multiprocessing
import os
import resource
import shutil
import struct
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from touchline.bench.tables import Row, aligned
from touchline.errors import InputError
from touchline.folder import make_folder

LONGEST = 30.0  # s that a file may take
MOST = 300.0  # MB that a file may take beyond three times its size
STARTS = 60.0  # s that a process may take to begin
SPAWN = multiprocessing.get_context("spawn")  # what has been imported here counts for nothing there
EXTREMES = (
    b"0",
    b"-1",
    b"nan",
    b"inf",
    b"-inf",
    b"1e308",
    b"1e-320",
    b"9" * 40,
    b"0x7f",
    b"+x",
    b"",
    b'"',
)
WORDS = (
    *(b"{", b"}", b"[", b"]", b":", b"- ", b"\t", b"\n", b"\x00", b"\xff\xfe", b"&a ", b"*a"),
    *(
        b"<",
        b"/>",
        b"</",
        b"<!DOCTYPE x [",
        b"&lt;",
        b"..",
        b"/",
        b"\\",
        b"!!python/none ",
        b"..\n",
    ),
)
URDF = b"""<robot name="two"><link name="a"/><link name="b">
<inertial><origin xyz="0 0 .1" rpy="0 0 0"/>
<mass value="2"/><inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size=".1 .1 .2"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 1" rpy="0 1 0"/>
<axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="10" velocity="3"/></joint></robot>
"""
MJCF = b"""<mujoco model="two"><option gravity="0 0 -9.81"/><worldbody><body name="b" pos="0 0 1">
<inertial pos="0 0 .1" mass="2" diaginertia=".01 .01 .01"/><joint name="j" axis="0 1 0"/>
<geom name="g" type="box" size=".05 .05 .1"/></body></worldbody></mujoco>
"""
YAML = b"""name: two
model: two.urdf
gravity: [0, 0, -9.81]
joints:
  - {name: j, torque: sensor, sign: 1, gain: 1.0, bias: 0.0, friction: {coulomb: 0.1, viscous: 0.2}}
force_torque_sensors:
  - {name: base, link: b, pose: {xyz: [0, 0, 0], rpy: [0, 0, 0]}, polarity: outboard}
noise: {q: 0.0, qd: 2.0e-4, tau: 0.05, base: [0.05, 0.05, 0.05, 0.01, 0.01, 0.01]}
observer: {bandwidth: 100.0}
"""
OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
RATE = 1000.0  # samples per second of all recordings
TOUCHED = 600  # samples of the recording that is analyzed
RESULTS = (
    *("analysis.json", "events.json"),
    *("postures.parquet", "estimates.parquet", "contacts.parquet"),
)
LEROBOT = ("data/chunk-000/file-000.parquet", "meta/info.json", "meta/stats.json")
COLUMNS = ("time", "q.j", "qd.j", "tau.j", *(f"base.{a}{b}" for a in "fm" for b in "xyz"))


@dataclass(frozen=True)
class Parser:
    """A kind of file.

    Attributes:
        name: for tables.
        file: its name; the ending tells the kind.
        seeds: whole files, which are damaged.
        read: reads one.
        refuses: what it raises for what cannot be used.
    """

    name: str
    file: str
    seeds: tuple[bytes, ...]
    read: Callable[[Path], object]
    refuses: type[Exception] = InputError


@dataclass(frozen=True)
class Failure:
    """A file that was not refused in words.

    Attributes:
        parser: its kind.
        number: of the file; with the seed it gives the same file again.
        what: last lines of the traceback, or the time that it took.
        data: the file.
    """

    parser: str
    number: int
    what: str
    data: bytes


def damaged(data: bytes, other: bytes, rng: np.random.Generator) -> bytes:
    """A file with one to four damages: bits, cuts, doubled parts, parts of another one, numbers."""
    out = bytearray(data)
    for _ in range(rng.integers(1, 5)):
        at = int(rng.integers(0, len(out) + 1))
        end = min(len(out), at + int(2 ** rng.uniform(0.0, 8.0)))
        kind = rng.integers(0, 9)
        if kind == 0 and out:
            out[at % len(out)] ^= 1 << int(rng.integers(0, 8))
        elif kind == 1:
            del out[at:end]
        elif kind == 2:
            out[at:at] = out[at:end] * int(rng.integers(1, 4))
        elif kind == 3:
            del out[at:]
        elif kind == 4:
            begin = int(rng.integers(0, len(other) + 1))
            out[at:end] = other[begin : begin + end - at]
        elif kind == 5:
            out[at:end] = rng.bytes(end - at)
        elif kind == 6:
            out[at:at] = WORDS[rng.integers(0, len(WORDS))]
        elif kind == 7:
            out[at : at + 4] = rng.choice([0, 1, 255, 2**31 - 1, 2**32 - 1]).astype("<u4").tobytes()
        else:
            _change_number(out, rng)
    return bytes(out)


def _change_number(out: bytearray, rng: np.random.Generator) -> None:
    places = [i for i in range(len(out)) if 48 <= out[i] < 58]
    if not places:
        return
    at = end = places[rng.integers(0, len(places))]
    while end < len(out) and out[end] in b"0123456789.e+-":
        end += 1
    out[at:end] = EXTREMES[rng.integers(0, len(EXTREMES))]


def parsers(folder: Path) -> list[Parser]:
    """All kinds of files; `folder` gets what they refer to."""
    from touchline.logs.log import read_log
    from touchline.model.loading import load_description
    from touchline.model.mesh_file import MeshError, read_mesh
    from touchline.model.robot import load_robot
    from touchline.native import core

    (folder / "two.urdf").write_bytes(URDF)
    (folder / "whole.yaml").write_bytes(YAML)
    description = load_description(folder / "whole.yaml")

    def log(path: Path) -> object:
        return read_log(path, description)

    def exported(path: Path) -> object:
        path.write_bytes(_sealed(path.read_bytes()))
        return core.read_robot(str(path))

    table = _table()
    bag, results, lerobot = _bag(table, folder), _results(folder), _lerobot(table, folder)
    mesh = {"read": read_mesh, "refuses": MeshError}
    return [
        Parser("yaml", "damaged.yaml", (YAML,), load_robot),
        Parser("URDF", "damaged.urdf", (URDF,), load_robot),
        Parser("MJCF", "damaged.xml", (MJCF,), load_robot),
        Parser("exported robot", "damaged.touchline", (_exported(folder),), exported, ValueError),
        Parser("mesh OBJ", "damaged.obj", (OBJ,), **mesh),
        Parser("mesh STL", "damaged.stl", (_stl(), _ascii_stl()), **mesh),
        Parser("CSV", "damaged.csv", (_csv(table),), log),
        Parser("CSV.gz", "damaged.csv.gz", (gzip.compress(_csv(table), mtime=0),), log),
        Parser("Parquet", "damaged.parquet", (_parquet(table, folder / "whole.parquet"),), log),
        Parser("MCAP, CDR", "damaged.mcap", (_mcap(table, folder),), log),
        Parser("rosbag2 sqlite3", "damaged.db3", (next(bag.glob("*.db3")).read_bytes(),), log),
        _within(bag, "metadata.yaml", log),
        *(_within(results, name, _replay) for name in RESULTS),
        *(_within(lerobot, name, _labelling(folder)) for name in LEROBOT),
        *_hdf5(table, folder),
        _arguments(),
        *_messages(),
    ]


def _within(whole: Path, name: str, read: Callable[[Path], object]) -> Parser:
    """A file within a folder, which is read as a whole with that file damaged."""

    def read_with(path: Path) -> object:
        copy = whole.with_name("damaged_folder")
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(whole, copy)
        shutil.copyfile(path, copy / name)
        return read(copy)

    kind, ending = name.rsplit("/", 1)[-1].rsplit(".", 1)
    title = f"{whole.name} {kind}.{ending}"
    return Parser(title, f"damaged_file.{ending}", ((whole / name).read_bytes(),), read_with)


def _replay(folder: Path) -> object:
    from touchline.view.replay import Replay

    return Replay(folder)


def _labelling(folder: Path) -> Callable[[Path], object]:
    """Adds the touch channel to a data set."""
    from touchline.label.naming import Given
    from touchline.label.run import label
    from touchline.model.robot import load_robot

    robot = load_robot(folder / "whole.yaml")
    names = [f"observation.{signal}" for signal in ("q", "qd", "tau", "wrench")]

    def read(path: Path) -> object:
        return label(path, robot, None, Given(*names, rate=RATE))

    return read


def _table(rows: int = 30) -> np.ndarray:
    time = np.arange(rows) / RATE
    waves = [0.1 * k * np.sin(9.0 * time + k) for k in range(1, len(COLUMNS))]
    return np.round(np.column_stack([time, *waves]), 6)


def _csv(table: np.ndarray) -> bytes:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    rows.writerows(table.tolist())
    return text.getvalue().encode()


def _parquet(table: np.ndarray, path: Path) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table(dict(zip(COLUMNS, table.T, strict=True))), path)
    return path.read_bytes()


def _exported(folder: Path) -> bytes:
    import touchline as tl

    path = folder / "whole.touchline"
    tl.Pipeline(tl.load_robot(folder / "whole.yaml")).export(path)
    return path.read_bytes()


def _sealed(data: bytes) -> bytes:
    """An exported robot whose length and checksum are right again: its reader then reads on."""
    head, body = data[:12], data[28:]
    checksum = 0xCBF29CE484222325  # FNV-1a of 64 bits, as in robot_file.hpp
    for byte in body:
        checksum = (checksum ^ byte) * 0x100000001B3 % 2**64
    return head + struct.pack("<QQ", len(body), checksum) + body


def _bag(table: np.ndarray, folder: Path) -> Path:
    """A rosbag2 of one joint's states and one sensor's wrenches."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    from touchline.logs.cdr import JOINT_STATE, WRENCH_STAMPED

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    vector = types["geometry_msgs/msg/Vector3"]
    path = folder / "bag"
    shutil.rmtree(path, ignore_errors=True)
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as file:
        kinds = {"/joint_states": JOINT_STATE, "/base/wrench": WRENCH_STAMPED}
        topics = {t: file.add_connection(t, k, typestore=store) for t, k in kinds.items()}
        for row in table:
            at = round(row[0] * 1e9)
            stamp = types["builtin_interfaces/msg/Time"](sec=0, nanosec=at)
            header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="base")
            fields = {"position": row[1:2], "velocity": row[2:3], "effort": row[3:4]}
            parts = {"force": vector(*row[4:7]), "torque": vector(*row[7:10])}
            wrench = types["geometry_msgs/msg/Wrench"](**parts)
            messages = {
                "/joint_states": types[JOINT_STATE](header=header, name=["j"], **fields),
                "/base/wrench": types[WRENCH_STAMPED](header=header, wrench=wrench),
            }
            for topic, message in messages.items():
                file.write(topics[topic], at, store.serialize_cdr(message, kinds[topic]))
    return path


def _results(folder: Path) -> Path:
    """What `analyze` writes of a recording with a touch."""
    from touchline.report.results import analyze

    table = _table(TOUCHED)
    table[TOUCHED // 2 :, COLUMNS.index("base.fx")] += 30.0
    log = folder / "touched.parquet"
    _parquet(table, log)
    analyze(log, folder / "whole.yaml", folder / "results")
    return folder / "results"


def _lerobot(table: np.ndarray, folder: Path) -> Path:
    """A data set of one episode, as LeRobot v3 writes it."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = folder / "lerobot"
    for name in LEROBOT:
        (path / name).parent.mkdir(parents=True, exist_ok=True)
    columns: dict[str, Any] = {"timestamp": table[:, 0].astype(np.float32)}
    counters = ("episode_index", "frame_index", "index", "task_index")
    columns |= {name: np.zeros(len(table), int) for name in counters}
    features = {name: {"dtype": "int64", "shape": [1], "names": None} for name in columns}
    for name, values in _observations(table).items():
        flat = pa.array(values.astype(np.float32).ravel())
        columns[f"observation.{name}"] = pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
        shape = {"dtype": "float32", "shape": [values.shape[1]], "names": None}
        features[f"observation.{name}"] = shape
    pq.write_table(pa.table(columns), path / LEROBOT[0])
    info = {"codebase_version": "v3.0", "fps": int(RATE), "features": features}
    (path / LEROBOT[1]).write_text(json.dumps(info), "utf-8")
    (path / LEROBOT[2]).write_text(json.dumps({"timestamp": {"mean": [0.0]}}), "utf-8")
    return path


def _hdf5(table: np.ndarray, folder: Path) -> list[Parser]:
    """None where h5py is not installed."""
    try:
        import h5py
    except ImportError:
        return []
    path = folder / "whole.h5"
    with h5py.File(path, "w") as file:
        for name, values in _observations(table).items():
            file[f"observation.{name}"] = values
    return [Parser("HDF5", "damaged.h5", (path.read_bytes(),), _labelling(folder))]


def _arguments() -> Parser:
    """Command lines, a word in each line, from the examples that `--help` gives; none is run."""
    from touchline.cli.main import BENCHMARKS, COMMANDS, understood

    texts = [command.__doc__ or "" for command in (*COMMANDS.values(), *BENCHMARKS.values())]
    lines = [line.split() for text in texts for line in text.splitlines() if "Example:" in line]
    seeds = tuple("\n".join(words[2:]).encode() for words in lines)

    def read(path: Path) -> object:
        words = path.read_bytes().decode("utf-8", "surrogateescape").split("\n")
        with contextlib.redirect_stdout(io.StringIO()):  # of the help that it may ask for
            return understood(words)

    return Parser("arguments", "damaged.txt", seeds, read)


@dataclass
class _Slider:
    value: float = 1.0
    min: float = 0.0
    max: float = 100.0


def _messages() -> list[Parser]:
    """What a visitor of a page sends: dropped, or such that the server reads it.

    None where viser is not installed.
    """
    try:
        import msgspec
        from viser import _messages as messages
    except ImportError:
        return []
    from touchline.view.gate import Gate

    gui = SimpleNamespace(_gui_input_handle_from_uuid={"slider": _Slider()})
    gate = Gate(cast(Any, SimpleNamespace(gui=gui)))
    third = (0.0, 0.6, 0.8)
    view = {"wxyz": (1.0, 0.0, 0.0, 0.0), "position": third, "fov": 0.9, "near": 0.1, "far": 9.0}
    view |= {"image_height": 600, "image_width": 800, "look_at": third, "up_direction": third}
    click = {"name": "/arm/link1", "instance_index": None, "screen_pos": (0.4, 0.6)}
    click |= {"ray_origin": third, "ray_direction": third, "modifier": None}
    sent = (
        {"type": "GuiUpdateMessage", "uuid": "slider", "updates": {"value": 30.5}},
        {"type": "ViewerCameraMessage", **view},
        {"type": "SceneNodeClickMessage", **click},
    )

    def read(path: Path) -> object:
        raw = path.read_bytes()
        return messages.Message.deserialize(raw) if gate.admits(raw) else raw

    return [Parser("WebSocket", "damaged.bin", tuple(map(msgspec.msgpack.encode, sent)), read)]


def _observations(table: np.ndarray) -> dict[str, np.ndarray]:
    return {"q": table[:, 1:2], "qd": table[:, 2:3], "tau": table[:, 3:4], "wrench": table[:, 4:]}


def _mcap(table: np.ndarray, folder: Path) -> bytes:
    from touchline.live.recorder import McapRecorder
    from touchline.live.sample import Sample
    from touchline.model.robot import load_robot

    path = folder / "whole.mcap"
    with McapRecorder(path, load_robot(folder / "whole.yaml"), {}) as file:
        for i, row in enumerate(table):
            signals = (row[1:2], row[2:3], row[3:4], row[4:].reshape(1, 6))
            file.add(Sample(row[0], *signals, ages=np.zeros(1), arrival=row[0], sequence=i))
    return path.read_bytes()


def _stl() -> bytes:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    faces = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]
    body = b"".join(bytes(12) + corners[list(f)].tobytes() + bytes(2) for f in faces)
    return bytes(80) + np.uint32(len(faces)).tobytes() + body


def _ascii_stl() -> bytes:
    corners = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    face = f"facet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\n"
    return f"solid x\n{face}endsolid x\n".encode()


def fuzz(
    parser: Parser, folder: Path, numbers: range, seed: int, others: tuple[bytes, ...]
) -> tuple[list[Failure], float]:
    """Reads damaged files of these numbers; the failures, and the longest time of one [s]."""
    found, longest = [], 0.0
    path = folder / parser.file
    for number in numbers:
        rng = np.random.default_rng([seed, number])
        data = damaged(
            parser.seeds[rng.integers(0, len(parser.seeds))],
            others[rng.integers(0, len(others))],
            rng,
        )
        before = _peak()
        failure, seconds = read_one(parser, path, data)
        longest = max(longest, seconds)
        taken = _peak() - before
        if not failure and taken > MOST + 3e-6 * len(data):
            failure = f"took {taken:.0f} MB"
        if failure:
            found.append(Failure(parser.name, number, failure, data))
    return found, longest


def _peak() -> float:
    """The most memory that this process has had so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def read_one(parser: Parser, path: Path, data: bytes) -> tuple[str, float]:
    """Reads one file: what is wrong with how it was taken ("": nothing), and the time [s]."""
    path.write_bytes(data)
    (path.parent / "last").write_bytes(data)
    start = time.perf_counter()
    what = ""
    try:
        parser.read(path)
    except parser.refuses as error:
        what = "" if str(error).strip() else "refused without a word"
    except Exception:  # that is what is looked for
        what = "".join(traceback.format_exc().splitlines(keepends=True)[-5:])
    seconds = time.perf_counter() - start
    return what or (f"took {seconds:.0f} s" if seconds > LONGEST else ""), seconds


def fuzz_apart(
    name: str,
    folder: Path,
    runs: int,
    seed: int,
    kinds: Callable[[Path], list[Parser]] = parsers,
) -> tuple[list[Failure], float, float]:
    """As `fuzz` with all files of a kind, in processes of their own, which a file may end.

    `kinds`: makes all parsers, in that process too.

    Returns:
        The failures, the longest time of one file [s], and the largest memory [MB].
    """
    found: list[Failure] = []
    longest = most = 0.0
    begin = 0
    while begin < runs:
        ours, theirs = SPAWN.Pipe(duplex=False)
        numbers = range(begin, runs)
        process = SPAWN.Process(
            target=_work, args=(theirs, kinds, name, folder, numbers, seed), daemon=True
        )
        process.start()
        theirs.close()
        number, waited = begin, True
        answer: tuple[list[Failure], float, float] | None = None
        try:
            while answer is None and (waited := ours.poll(STARTS + LONGEST)):
                told = ours.recv()
                if isinstance(told, int):
                    number = told
                else:
                    answer = told
        except EOFError:  # it has ended
            pass
        if not waited:
            process.kill()
        process.join()
        if answer is None:
            what = (
                f"ended the process ({process.exitcode})"
                if waited
                else f"took over {LONGEST:.0f} s"
            )
            found.append(Failure(name, number, what, (folder / "last").read_bytes()))
            begin = number + 1
            continue
        failures, seconds, memory = answer
        found += failures
        longest, most, begin = max(longest, seconds), max(most, memory), runs
    return found, longest, most


def _work(
    told: Connection,
    make: Callable[[Path], list[Parser]],
    name: str,
    folder: Path,
    numbers: range,
    seed: int,
) -> None:
    """In a process of its own: tells each number before its file is read, and all at the end."""
    kinds = make(folder)
    others = tuple(s for parser in kinds for s in parser.seeds)
    parser = next(parser for parser in kinds if parser.name == name)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # what libraries print of damaged files
    failures, longest = [], 0.0
    for number in numbers:
        told.send(number)
        found, seconds = fuzz(parser, folder, range(number, number + 1), seed, others)
        failures += found
        longest = max(longest, seconds)
    told.send((failures, longest, _peak()))


def main(runs: int, seed: int, keep: Path | None) -> int:
    """Prints a line for each kind of file; 1 where one was not refused in words."""
    rows: list[Row] = [("files", "damaged", "failed", "longest", "memory")]
    failed = 0
    if keep is not None:
        make_folder(keep)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for parser in parsers(folder):
            found, longest, most = fuzz_apart(parser.name, folder, runs, seed)
            failed += len(found)
            rows.append(
                (
                    *(parser.name, str(runs), str(len(found))),
                    *(f"{1e3 * longest:.0f} ms", f"{most:.0f} MB"),
                )
            )
            for failure in found[:3]:
                print(f"{failure.parser} {failure.number}:\n{failure.what}")
            if keep is not None:
                for failure in found:
                    stem = f"{failure.parser.replace(' ', '_')}_{failure.number}"
                    (keep / stem).write_bytes(failure.data)
    print(aligned(rows))
    return int(failed > 0)
