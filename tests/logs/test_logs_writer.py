# SPDX-License-Identifier: Apache-2.0
"""Result files: columns, nulls, parts, and what a killed run leaves."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from touchline.errors import InputError
from touchline.logs import EstimateWriter, TableWriter, remove_results, writer


@pytest.fixture
def small_parts(monkeypatch):
    monkeypatch.setattr(writer, "PART_ROWS", 100)
    monkeypatch.setattr(writer, "_GROUP_ROWS", 40)


def write_rows(table, count, step=30):
    for first in range(0, count, step):
        x = np.arange(first, min(first + step, count))
        table.write({"x": x, "y": np.where(x % 7, x / 2, np.nan), "s": [f"r{i}" for i in x]})


SCHEMA = {"x": "i8", "y": "f8", "s": "str"}


@pytest.mark.parametrize("count", [0, 1, 99, 100, 101, 1000])
def test_parts_become_one_table(tmp_path, small_parts, count):
    path = tmp_path / "deep" / "table.parquet"
    with TableWriter(path, SCHEMA) as table:
        write_rows(table, count)
        assert table.rows == count
    read = pq.read_table(path)
    assert read["x"].to_pylist() == list(range(count))
    assert read["s"].to_pylist() == [f"r{i}" for i in range(count)]
    assert read["y"].null_count == len(range(0, count, 7))
    assert [p.name for p in path.parent.iterdir()] == ["table.parquet"]


def test_small_writes_make_no_small_row_groups(tmp_path, small_parts):
    with TableWriter(tmp_path / "table.parquet", SCHEMA) as table:
        write_rows(table, 1000, step=1)
    assert pq.ParquetFile(tmp_path / "table.parquet").num_row_groups <= 30


def test_finished_parts_can_be_read_after_a_failure(tmp_path, small_parts):
    with pytest.raises(RuntimeError), TableWriter(tmp_path / "table.parquet", SCHEMA) as table:
        write_rows(table, 250)
        raise RuntimeError
    assert not (tmp_path / "table.parquet").exists()
    assert pq.read_table(tmp_path / "table.parts")["x"].to_pylist() == list(range(250))


KILLED = """
import os, signal, sys
import numpy as np
from touchline.logs import EstimateWriter, writer
writer.PART_ROWS, writer._GROUP_ROWS = 1000, 200
estimates = EstimateWriter(sys.argv[1], ["j"], ["base"], ["base"])
for first in range(0, 10_000, 300):
    n = 300
    time = 0.001 * np.arange(first, first + n)
    wrench = np.zeros((n, 1, 6))
    estimates.write(time, np.zeros(n, int), np.zeros((n, 1)), wrench, wrench)
    if first > 5_000:
        os.kill(os.getpid(), signal.SIGKILL)
"""


def test_killed_run_leaves_what_it_finished(tmp_path):
    source = Path(writer.__file__).parents[2]
    environment = os.environ | {"PYTHONPATH": str(source)}
    command = [sys.executable, "-c", KILLED, str(tmp_path)]
    result = subprocess.run(command, env=environment, check=False)
    assert result.returncode == -signal.SIGKILL
    assert not (tmp_path / "estimates.parquet").exists()
    time = pq.read_table(tmp_path / "estimates.parts")["time"].to_numpy()
    assert len(time) >= 4800
    np.testing.assert_allclose(time, 0.001 * np.arange(len(time)))
    # The next run replaces it all.
    with EstimateWriter(tmp_path, ["j"], ["base"], ["base"]) as estimates:
        one = np.zeros((1, 1, 6))
        estimates.write(np.zeros(1), np.zeros(1), np.zeros((1, 1)), one, one)
    assert [p.name for p in tmp_path.iterdir()] == ["estimates.parquet"]
    assert pq.read_table(tmp_path / "estimates.parquet").num_rows == 1


def test_slow_runs_close_parts_by_time(tmp_path, monkeypatch):
    monkeypatch.setattr(writer, "PART_SECONDS", 0.0)
    table = TableWriter(tmp_path / "table.parquet", SCHEMA)
    write_rows(table, 90, step=30)
    assert pq.read_table(tmp_path / "table.parts").num_rows == 90
    table.close()
    assert pq.read_table(tmp_path / "table.parquet").num_rows == 90


def test_estimates_have_the_columns_of_the_contract(tmp_path):
    rng = np.random.default_rng(0)
    tau, sensor, segment = rng.normal(size=(5, 2)), rng.normal(size=(5, 1, 6)), np.ones((5, 2, 6))
    segment[:, 0] = np.nan
    names = ["a", "b"], ["base"], ["root", "base"]
    with EstimateWriter(tmp_path, *names, extra={"alarm": "bool"}) as estimates:
        health = np.arange(5, dtype=np.uint32)
        estimates.write(np.arange(5.0), health, tau, sensor, segment, alarm=health > 2)
    read = pq.read_table(tmp_path / "estimates.parquet")
    expected = ["time", "health", "tau_ext.a", "tau_ext.b"]
    for name in ("base.ext", "root.seg", "base.seg"):
        expected += [f"{name}.{axis}" for axis in ("fx", "fy", "fz", "mx", "my", "mz")]
    assert read.column_names == [*expected, "alarm"]
    np.testing.assert_array_equal(read["tau_ext.b"].to_numpy(), tau[:, 1])
    np.testing.assert_array_equal(read["base.ext.mx"].to_numpy(), sensor[:, 0, 3])
    assert read["root.seg.fx"].null_count == 5 and read["base.seg.fx"].null_count == 0
    assert read["health"].to_pylist() == [0, 1, 2, 3, 4]
    assert read["alarm"].to_pylist() == [False, False, False, True, True]


def test_metadata_is_kept(tmp_path):
    from touchline.logs.parquet import METADATA_KEY

    with TableWriter(tmp_path / "t.parquet", {"x": "f8"}, {"links": ["a"]}) as table:
        table.write({"x": [1.0]})
    assert pq.read_schema(tmp_path / "t.parquet").metadata[METADATA_KEY] == b'{"links": ["a"]}'


def test_wrong_columns_are_refused(tmp_path):
    table = TableWriter(tmp_path / "t.parquet", {"x": "f8"})
    with pytest.raises(ValueError, match="missing or unknown columns: x, z"):
        table.write({"z": [1.0]})


@pytest.mark.parametrize("y", [[1.0], 1.0, np.ones((2, 1))])
def test_columns_of_other_lengths_or_shapes_are_refused(tmp_path, y):
    table = TableWriter(tmp_path / "t.parquet", {"x": "f8", "y": "f8", "word": "str"})
    with pytest.raises(ValueError, match="different lengths or shapes"):
        table.write({"x": [1.0, 2.0], "y": y, "word": ["a", "b"]})


def test_groups_hold_the_same_however_rows_came(tmp_path, small_parts):
    """A group is written from one place in memory, again and again."""
    x = np.arange(95.0)
    x[[3, 41, 94]] = np.nan
    words = [None if k % 7 == 0 else f"w{k}" for k in range(95)]
    read = []
    for step in (1, 17, 40, 95):
        path = tmp_path / f"{step}.parquet"
        with TableWriter(path, {"x": "f8", "word": "str", "n": "i8"}) as table:
            for i in range(0, 95, step):
                rows = slice(i, i + step)
                n = np.arange(95)[rows]
                table.write({"x": x[rows], "word": words[rows], "n": n})
        read.append(pq.read_table(path))
        groups = pq.ParquetFile(path).metadata
        assert groups.row_group(0).num_rows == 40
    assert all(one.equals(read[0]) for one in read)
    assert read[0]["x"].null_count == 3 and read[0]["word"].to_pylist() == words
    np.testing.assert_array_equal(read[0]["x"].to_numpy(), x)


def test_place_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        EstimateWriter(tmp_path / "file", ["j"], [], [])


def test_old_results_are_removed(tmp_path):
    for name in ("estimates.parquet", "contacts.parquet", "events.json", "report.html", "notes"):
        (tmp_path / name).write_text("old")
    (tmp_path / "contacts.parts").mkdir()
    remove_results(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["notes"]
