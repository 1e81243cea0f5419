# SPDX-License-Identifier: Apache-2.0
"""Damaged files of each kind are read or refused in words; the runner finds what is neither."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import touchline as tl
from touchline.cli import fuzz as fuzz_module
from touchline.cli import main
from touchline.cli.fuzz import Failure, Parser, damaged, fuzz, fuzz_apart, parsers, read_one

RUNS, SEED = 25, 1


def test_a_damage_is_the_same_again_and_is_one():
    data, other = bytes(range(200)), b"0123456789" * 9
    first = [damaged(data, other, np.random.default_rng(i)) for i in range(50)]
    again = [damaged(data, other, np.random.default_rng(i)) for i in range(50)]
    assert first == again
    assert sum(x != data for x in first) > 45


def test_each_whole_file_is_read(tmp_path):
    for parser in parsers(tmp_path):
        for seed in parser.seeds:
            path = tmp_path / parser.file
            path.write_bytes(seed)
            assert parser.read(path) is not None


def test_damaged_files_are_refused_in_words(tmp_path):
    kinds = parsers(tmp_path)
    others = tuple(s for parser in kinds for s in parser.seeds)
    for parser in kinds:
        found, longest = fuzz(parser, tmp_path, range(RUNS), SEED, others)
        assert [(f.parser, f.number, f.what) for f in found] == []
        assert longest < 30.0


@pytest.mark.parametrize("error", [ValueError("x"), KeyError("y"), MemoryError()])
def test_the_runner_finds_what_is_not_refused_in_words(tmp_path, error):
    def read(path):
        if len(path.read_bytes()) % 2:
            raise error
        return path

    found, _ = fuzz(Parser("odd", "a.bin", (b"abc123",), read), tmp_path, range(30), 0, (b"zz",))
    assert 3 < len(found) < 30
    assert type(error).__name__ in found[0].what and len(found[0].data) % 2


def test_a_number_that_is_none_in_an_mjcf_is_refused_and_leaves_no_log(tmp_path, monkeypatch):
    from touchline.cli.fuzz import MJCF

    monkeypatch.chdir(tmp_path)
    path = tmp_path / "arm.xml"
    path.write_bytes(MJCF.replace(b'pos="0 0 1"', b'pos="0 0 nan"'))
    with pytest.raises(tl.InputError, match=r"arm\.xml: .*NaN"):
        tl.load_robot(path)
    assert [p.name for p in tmp_path.iterdir()] == ["arm.xml"]


DAMAGED_FOOTER = Path(__file__).parent / "corpus" / "statistics_of_another_size.parquet"


def test_a_parquet_file_that_ends_pyarrow_is_refused_in_one_line(tmp_path, capsys):
    for parser in parsers(tmp_path):
        if parser.name == "Parquet":
            what, _ = read_one(parser, tmp_path / parser.file, DAMAGED_FOOTER.read_bytes())
            assert what == ""
    (tmp_path / "log.parquet").write_bytes(DAMAGED_FOOTER.read_bytes())
    log, robot = tmp_path / "log.parquet", tmp_path / "whole.yaml"
    status = main(["analyze", str(log), "--robot", str(robot), "--out", str(tmp_path / "out")])
    lines = capsys.readouterr().err.strip().splitlines()
    assert status == 2 and len(lines) == 1 and "log.parquet: damaged" in lines[0]


DAMAGED_PAGE = Path(__file__).parent / "corpus" / "page_of_two_gigabytes.parquet"


def test_no_room_is_made_for_what_a_damaged_page_claims_to_hold(tmp_path):
    (parquet,) = (parser for parser in parsers(tmp_path) if parser.name == "Parquet")
    data = DAMAGED_PAGE.read_bytes()
    assert read_one(parquet, tmp_path / parquet.file, data)[0] == ""
    words = [sys.executable, "-c", READ, str(tmp_path / parquet.file), str(tmp_path / "whole.yaml")]
    run = subprocess.run(words, capture_output=True, text=True, check=True)
    taken, said = run.stdout.split(maxsplit=1)
    assert "Page was smaller" in said and float(taken) < 300.0  # MB; 2,050 with room for the page


READ = """
import resource, sys
import touchline as tl
from touchline.logs.log import read_log
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
robot = tl.load_robot(sys.argv[2])
before = peak()
try:
    read_log(sys.argv[1], robot)
except tl.InputError as error:
    print(peak() - before, error)
"""


def ending(folder):
    """A kind of file that ends its process now and then."""

    def read(path):
        if len(path.read_bytes()) % 3 == 0:
            os.abort()
        return path

    return [Parser("ending", "a.bin", (b"abc123",), read)]


def test_a_file_that_ends_its_process_is_found_and_the_rest_is_read(tmp_path):
    found, _, _ = fuzz_apart("ending", tmp_path, 12, SEED, ending)
    assert 1 <= len(found) <= 8 and found[0].data
    assert all("ended the process" in f.what and len(f.data) % 3 == 0 for f in found)


def test_what_was_found_is_printed_and_kept(tmp_path, monkeypatch, capsys):
    kinds = [Parser(name, "a.bin", (b"abc",), lambda path: path) for name in ("good", "bad one")]
    monkeypatch.setattr(fuzz_module, "parsers", lambda folder: kinds)
    failures = {"good": [], "bad one": [Failure("bad one", 7, "Traceback", b"xyz")]}
    monkeypatch.setattr(
        fuzz_module, "fuzz_apart", lambda name, folder, runs, seed: (failures[name], 0.25, 90.0)
    )
    assert main(["bench", "fuzz", "--runs", "9", "--keep", str(tmp_path / "kept")]) == 1
    told = capsys.readouterr().out
    assert "bad one 7:\nTraceback" in told
    assert [line.split()[-6:] for line in told.splitlines()[-2:]] == [
        ["9", "0", "250", "ms", "90", "MB"],
        ["9", "1", "250", "ms", "90", "MB"],
    ]
    assert (tmp_path / "kept" / "bad_one_7").read_bytes() == b"xyz"
    failures["bad one"] = []
    assert main(["bench", "fuzz", "--runs", "9"]) == 0
