# SPDX-License-Identifier: Apache-2.0
"""`touchline bench fuzz`: damaged files for each parser; prints those not refused in words."""

import csv
import gzip
import io
import multiprocessing
import os
import resource
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from touchline.bench.tables import Row, aligned
from touchline.errors import InputError

LONGEST = 30.0  # s that a file may take
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

    (folder / "two.urdf").write_bytes(URDF)
    (folder / "whole.yaml").write_bytes(YAML)
    description = load_description(folder / "whole.yaml")

    def log(path: Path) -> object:
        return read_log(path, description)

    table = _table()
    mesh = {"read": read_mesh, "refuses": MeshError}
    return [
        Parser("yaml", "damaged.yaml", (YAML,), load_robot),
        Parser("URDF", "damaged.urdf", (URDF,), load_robot),
        Parser("MJCF", "damaged.xml", (MJCF,), load_robot),
        Parser("mesh OBJ", "damaged.obj", (OBJ,), **mesh),
        Parser("mesh STL", "damaged.stl", (_stl(), _ascii_stl()), **mesh),
        Parser("CSV", "damaged.csv", (_csv(table),), log),
        Parser("CSV.gz", "damaged.csv.gz", (gzip.compress(_csv(table), mtime=0),), log),
        Parser("Parquet", "damaged.parquet", (_parquet(table, folder),), log),
        Parser("MCAP, CDR", "damaged.mcap", (_mcap(table, folder),), log),
    ]


def _table() -> np.ndarray:
    time = np.arange(30) * 1e-3
    waves = [0.1 * k * np.sin(9.0 * time + k) for k in range(1, len(COLUMNS))]
    return np.round(np.column_stack([time, *waves]), 6)


def _csv(table: np.ndarray) -> bytes:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    rows.writerows(table.tolist())
    return text.getvalue().encode()


def _parquet(table: np.ndarray, folder: Path) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = folder / "whole.parquet"
    pq.write_table(pa.table(dict(zip(COLUMNS, table.T, strict=True))), path)
    return path.read_bytes()


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
        failure, seconds = read_one(parser, path, data)
        longest = max(longest, seconds)
        if failure:
            found.append(Failure(parser.name, number, failure, data))
    return found, longest


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
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    told.send((failures, longest, most))


def main(runs: int, seed: int, keep: Path | None) -> int:
    """Prints a line for each kind of file; 1 where one was not refused in words."""
    rows: list[Row] = [("files", "damaged", "failed", "longest", "memory")]
    failed = 0
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
                keep.mkdir(parents=True, exist_ok=True)
                for failure in found:
                    stem = f"{failure.parser.replace(' ', '_')}_{failure.number}"
                    (keep / stem).write_bytes(failure.data)
    print(aligned(rows))
    return int(failed > 0)
