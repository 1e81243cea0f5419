# SPDX-License-Identifier: Apache-2.0
"""Recordings that are elsewhere, and work that is done elsewhere: the same results."""

import functools
import http.server
import shutil
import sys
import threading
from contextlib import contextmanager
from dataclasses import replace

import pytest
from free_motion import free_motion, pushed

import touchline as tl
from touchline.cli import main
from touchline.errors import InputError
from touchline.fleet.manifest import Manifest
from touchline.fleet.plan import is_single, make_plan
from touchline.fleet.work import Job, done
from touchline.logs import write_table
from touchline.logs.mcap import SCENE
from touchline.logs.mcap_writer import McapWriter

OPTIONS = {"bandwidth": None, "method": "segment", "report": "none"}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    robot = tl.load_robot("sara")
    for seed, name in enumerate(("a", "b", "c")):
        samples = free_motion(robot, seconds=2.0, rate=200.0, seed=seed)
        samples = pushed(robot, samples, "link0", slice(200, 300), [30.0, 0.0, 0.0])
        write_table(folder / f"{name}.parquet", samples, robot.description)
    (folder / "empty.csv").write_bytes(b"")
    (folder / "notes.txt").write_text("mine")
    return folder


def results(out):
    found = Manifest(out).rows
    return {name: (r["status"], r["content"], r["outputs"]) for name, r in found.items()}


def run(*arguments):
    return main(["analyze", *map(str, arguments), "--robot", "sara", "--report", "none"])


@pytest.fixture(scope="module")
def local(made, tmp_path_factory):
    out = tmp_path_factory.mktemp("local")
    assert run(made, "--out", out, "--workers", 1) == 3
    return results(out)


def without_origin(found):
    """All but `analysis.json`, which tells where the recording is."""
    return {
        name: (status, content, {k: v for k, v in files.items() if k != "analysis.json"})
        for name, (status, content, files) in found.items()
    }


def test_recordings_in_memory(made, tmp_path, local):
    fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed: touchline[fleet]")
    memory = fsspec.filesystem("memory")
    for path in made.iterdir():
        memory.pipe(f"/runs/{path.name}", path.read_bytes())
    for words in (["memory://runs"], ["memory://runs/*.parquet", "memory://runs/empty.csv"]):
        plan = make_plan(words, "sara")
        assert [r.name for r in plan] == ["a", "b", "c", "empty"] and not is_single(words)
    for recording in plan:
        row = done(Job(recording, tmp_path, "", OPTIONS))
        assert row["log"] == f"memory:///runs/{recording.url.rsplit('/', 1)[-1]}"
        told = {recording.name: (row["status"], row["content"], row["outputs"])}
        expected = {recording.name: local[recording.name]}
        assert without_origin(told) == without_origin(expected)
        assert not list(tmp_path.rglob(".fetched"))
    gone = replace(plan[0], url="memory://runs/gone.parquet")
    row = done(Job(gone, tmp_path, "", OPTIONS))
    assert row["status"] == "failed" and "gone.parquet" in row["reason"]
    with pytest.raises(InputError, match="no recordings there"):
        make_plan(["memory://nothing"], "sara")
    with pytest.raises(InputError, match="nosuch"):
        make_plan(["nosuch://a"], "sara")


def test_results_beside_recordings_elsewhere_are_none(made, tmp_path):
    fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed: touchline[fleet]")
    shutil.copy(made / "a.parquet", tmp_path / "one.parquet")
    assert run(tmp_path, "--out", tmp_path, "--workers", 1) == 0
    assert (tmp_path / "tables").is_dir() and (tmp_path / "one" / "estimates.parquet").exists()
    memory = fsspec.filesystem("memory")
    memory.put(str(tmp_path), "/beside", recursive=True)
    for url in (f"file://{tmp_path}", f"file://{tmp_path}/**", "memory://beside"):
        assert [r.name for r in make_plan([url], "sara")] == ["one"], url
    named = make_plan(["memory://beside/one.parquet", "memory://beside/fleet.html"], "sara")
    assert [r.name for r in named] == ["one"] and list(named.none) == ["memory://beside/fleet.html"]


def test_what_a_viewer_is_shown_is_told_when_it_is_fetched(tmp_path):
    fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed: touchline[fleet]")
    writer = McapWriter(tmp_path / "shown.mcap", {})
    writer.add_channel("/robot", SCENE, "")
    writer.close()
    data = (tmp_path / "shown.mcap").read_bytes()
    fsspec.filesystem("memory").pipe("/shown/shown.mcap", data)
    (recording,) = make_plan(["memory://shown"], "sara")
    row = done(Job(recording, tmp_path / "out", "", OPTIONS))
    assert row["status"] == "skipped" and "made for a viewer" in row["reason"]


@contextmanager
def served(folder):
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(folder))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()


def test_recordings_by_http(made, tmp_path, local):
    pytest.importorskip("aiohttp", reason="aiohttp is not installed: touchline[fleet]")
    with served(made) as address:
        urls = [f"{address}/{name}.parquet" for name in "abc"]
        assert run(*urls, "--out", tmp_path / "out", "--workers", 2) == 0
        assert run(*urls, "--out", tmp_path / "out", "--workers", 1) == 0
    expected = {name: row for name, row in local.items() if name != "empty"}
    assert without_origin(results(tmp_path / "out")) == without_origin(expected)


def test_urls_that_cannot_be_read_are_told_with_the_reason(made, tmp_path, monkeypatch, capsys):
    pytest.importorskip("aiohttp", reason="aiohttp is not installed: touchline[fleet]")
    with served(made) as address:
        assert run(f"{address}/gone.parquet", "--out", tmp_path / "out") == 2
        assert "404" in capsys.readouterr().err
    assert run(f"{address}/a.parquet", "--out", tmp_path / "out") == 2  # nobody listens any more
    told = capsys.readouterr().err
    assert "server does not answer" in told and "Cannot connect to host" in told
    assert run(f"{address}/", "--out", tmp_path / "out") == 2  # fsspec finds nothing
    told = capsys.readouterr().err
    assert "server does not answer" in told and "no recordings there" not in told
    assert not (tmp_path / "out").exists()


def test_errors_of_any_kind_of_url_are_told(tmp_path, monkeypatch, capsys):
    fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed: touchline[fleet]")

    def without_credentials(*_):
        raise RuntimeError("Unable to locate credentials")

    monkeypatch.setattr(fsspec.get_filesystem_class("memory"), "isdir", without_credentials)
    assert run("memory://bucket/a.parquet", "--out", tmp_path / "out") == 2
    assert "memory://bucket/a.parquet: cannot be read: Unable to" in capsys.readouterr().err
    assert run("memroy://bucket/a.parquet", "--out", tmp_path / "out") == 2
    assert "memroy; known are http" in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_a_cluster_that_does_not_answer_is_told_before_anything_is_written(
    made, tmp_path, monkeypatch, capsys
):
    pytest.importorskip("distributed", reason="distributed is not installed: touchline[fleet]")
    monkeypatch.setattr("touchline.fleet.cluster.PATIENCE", 0.5)
    for address in ("tcp://127.0.0.1:1", "nonsense"):
        assert run(made, "--out", tmp_path / "out", "--cluster", address) == 2
        assert f"--cluster {address}: cannot be reached" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_recordings_by_file_url_and_list(made, tmp_path, local):
    pytest.importorskip("fsspec", reason="fsspec is not installed: touchline[fleet]")
    listed = tmp_path / "list.csv"
    listed.write_text(f"log,robot\nfile://{made}/a.parquet,sara\n{made}/b.parquet,sara\n")
    assert run(listed, "--out", tmp_path / "out", "--workers", 1) == 0
    found = without_origin(results(tmp_path / "out"))
    values = sorted(found.values(), key=str)
    assert values == sorted((without_origin(local)[n] for n in "ab"), key=str)


def test_limits_of_a_cluster_are_its_own(made, tmp_path, capsys):
    address = ("--cluster", "tcp://127.0.0.1:1")
    for other in (("--workers", 2), ("--time-limit", 1), ("--memory-limit", 1)):
        assert run(made, "--out", tmp_path / "out", *address, *other) == 2
        assert "not with --cluster" in capsys.readouterr().err


@pytest.mark.parametrize("workers", [1, 2, 4])
def test_a_cluster_gives_the_same_results(made, tmp_path, local, workers):
    distributed = pytest.importorskip(
        "distributed", reason="distributed is not installed: touchline[fleet]"
    )
    cluster = distributed.LocalCluster(
        n_workers=workers, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    )
    with cluster:
        address = cluster.scheduler_address
        assert run(made, "--out", tmp_path / "out", "--cluster", address) == 3
        assert results(tmp_path / "out") == local
        shutil.rmtree(tmp_path / "out" / "b")
        assert run(made, "--out", tmp_path / "out", "--cluster", address) == 3
    assert results(tmp_path / "out") == local


@pytest.mark.parametrize(
    ("url", "package", "extra"),
    [
        ("http://host/x.parquet", "aiohttp", "fleet"),
        ("s3://bucket/x.parquet", "s3fs", "s3"),
        ("gs://bucket/x.parquet", "gcsfs", "gs"),
    ],
)
def test_a_missing_package_is_told_with_its_extra(
    url, package, extra, tmp_path, monkeypatch, capsys
):
    fsspec = pytest.importorskip("fsspec")

    def absent(_):
        raise ImportError("as fsspec words it")

    monkeypatch.setattr(fsspec.core, "url_to_fs", absent)
    assert run(url, "--out", tmp_path / "out") == 1
    told = capsys.readouterr().err
    assert told == f"touchline: {package} is not installed: pip install 'touchline[{extra}]'\n"
    assert not (tmp_path / "out").exists()


def test_a_cluster_without_its_package_leaves_nothing(made, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "distributed", None)
    out = tmp_path / "out"
    assert run(made, "--out", out, "--cluster", "tcp://127.0.0.1:1") == 1
    assert "pip install 'touchline[fleet]'" in capsys.readouterr().err
    assert not out.exists()
