# SPDX-License-Identifier: Apache-2.0
"""Pairs of points in lanes: the forces that explain best, however many lanes there are."""

from pathlib import Path

import numpy as np
import pytest
from program import COMPILER, compile_program, run_program

SCALE = 50.0  # N, as in the program

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C++ compiler on this machine")


@pytest.fixture(scope="module")
def lines(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lanes")
    outputs = []
    for name, flags in {"two": ("-O2",), "four": ("-O2", "-mavx")}.items():
        complaint = compile_program(
            Path(__file__).parent / "start_lanes.cpp", folder / name, *flags
        )
        if "-mavx" in complaint or (name == "four" and "avx" not in _cpu()):
            continue
        assert complaint == ""
        outputs.append(run_program(folder / name).stdout)
    assert all(output == outputs[0] for output in outputs)
    return [line.split() for line in outputs[0].splitlines()]


def test_pairs_have_the_forces_of_least_squares(lines):
    def numbers(word):
        return [np.array(line[1:], dtype=float) for line in lines if line[0] == word]

    (target,) = numbers("target")
    columns = []  # of each body: (starts, rows, 3)
    for m, p in zip(numbers("map"), numbers("points"), strict=True):
        rows, points = m.reshape(-1, 6), p.reshape(-1, 3)
        unit = np.eye(3)
        wrenches = np.concatenate(
            [np.broadcast_to(unit, (len(points), 3, 3)), np.cross(points[:, None], unit)], axis=2
        )
        columns.append(np.einsum("rk,sfk->srf", rows, wrenches))
    pairs = numbers("pair")
    assert len(pairs) == len(columns[0]) * len(columns[1])
    for i, j, misfit, *force in pairs:
        J = np.hstack([columns[0][int(i)], columns[1][int(j)]])
        J, y = np.vstack([J, np.eye(6) / SCALE]), np.r_[target, np.zeros(6)]
        best, *_ = np.linalg.lstsq(J, y, rcond=None)
        np.testing.assert_allclose(force, best, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(misfit, np.sum((y - J @ best) ** 2), rtol=1e-8)


def test_angles_are_those_of_the_arc_cosine(lines):
    x, angle = np.array([line[1:] for line in lines if line[0] == "angle"], dtype=float).T
    np.testing.assert_allclose(angle, np.arccos(np.clip(x, -1.0, 1.0)), atol=3e-8)


def _cpu():
    info = Path("/proc/cpuinfo")
    return info.read_text() if info.exists() else ""
