# SPDX-License-Identifier: Apache-2.0
"""Damaged files of each kind are read or refused in words; the runner finds what is neither."""

import numpy as np
import pytest

import touchline as tl
from touchline.bench.fuzz import Parser, damaged, fuzz, parsers

RUNS, SEED = 40, 1


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
        found, longest = fuzz(parser, tmp_path, RUNS, SEED, others)
        assert [(f.parser, f.number, f.what) for f in found] == []
        assert longest < 30.0


@pytest.mark.parametrize("error", [ValueError("x"), KeyError("y"), MemoryError()])
def test_the_runner_finds_what_is_not_refused_in_words(tmp_path, error):
    def read(path):
        if len(path.read_bytes()) % 2:
            raise error
        return path

    found, _ = fuzz(Parser("odd", "a.bin", (b"abc123",), read), tmp_path, 30, 0, (b"zz",))
    assert 3 < len(found) < 30
    assert type(error).__name__ in found[0].what and len(found[0].data) % 2


def test_a_number_that_is_none_in_an_mjcf_is_refused_and_leaves_no_log(tmp_path, monkeypatch):
    from touchline.bench.fuzz import MJCF

    monkeypatch.chdir(tmp_path)
    path = tmp_path / "arm.xml"
    path.write_bytes(MJCF.replace(b'pos="0 0 1"', b'pos="0 0 nan"'))
    with pytest.raises(tl.InputError, match=r"arm\.xml: .*NaN"):
        tl.load_robot(path)
    assert [p.name for p in tmp_path.iterdir()] == ["arm.xml"]
