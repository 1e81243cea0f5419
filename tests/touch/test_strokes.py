# SPDX-License-Identifier: Apache-2.0
"""Strokes are cleaned without delay, and read by examples."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from touchline.touch import Recognizer, Stroke


def circle(turns=1.0, noise=0.0, seed=0):
    time = np.arange(0.0, 2.0, 1e-3)
    angle = 2 * np.pi * turns * time / 2.0
    way = 0.025 * np.column_stack([np.sin(angle), np.cos(angle)])
    way += noise * np.random.default_rng(seed).normal(size=way.shape)
    return time, way


def test_cleaning_takes_noise_out_and_adds_no_delay():
    time, true = circle()
    _, noisy = circle(noise=1e-3)
    cleaned = Stroke("pad", "link", np.column_stack([time, noisy]), np.full(len(time), 5.0))
    cleaned = cleaned.cleaned()
    rows = np.searchsorted(time, cleaned.points[:, 0])
    off = cleaned.points[:, 1:] - true[rows]
    assert np.sqrt(np.mean(off**2)) < 3e-4
    assert np.abs(off.mean(axis=0)).max() < 5e-5


def test_landing_and_strays_are_left_out():
    time, way = circle()
    way = way.copy()
    way[1000] += 0.05
    force = np.minimum(5.0, 5.0 * np.minimum(time, time[-1] - time) / 0.1)
    cleaned = Stroke("pad", "link", np.column_stack([time, way]), force).cleaned()
    assert cleaned.points[0, 0] >= 0.05 and cleaned.points[-1, 0] <= time[-1] - 0.05
    assert 1.0 not in cleaned.points[:, 0]


def test_json_brings_it_back_and_svg_shows_it():
    time, way = circle()
    stroke = Stroke("pad", "link", np.column_stack([time, way])[::100], np.ones(20))
    again = Stroke.from_json(stroke.as_json())
    assert again.points == pytest.approx(stroke.points) and again.widget == "pad"
    assert stroke.as_svg().startswith("<svg") and "polyline" in stroke.as_svg()


SHAPES = {
    "line": [[0, 0], [1, 0.02]],
    "hook": [[0, 0], [1, 0], [1, 1]],
    "zigzag": [[0, 0], [1, 0], [0, 1], [1, 1]],
}


@given(
    st.sampled_from(sorted(SHAPES)),
    st.floats(1e-3, 1e3),
    st.tuples(st.floats(-10, 10), st.floats(-10, 10)),
)
def test_size_and_place_do_not_matter(label, size, shift):
    recognizer = Recognizer()
    recognizer.learn([np.array(way, float) for way in SHAPES.values()], list(SHAPES))
    way = size * (np.array(SHAPES[label], float) + shift)
    assert recognizer.read(way)[0][0] == label


def test_probabilities_sum_to_one_and_nothing_learnt_is_nothing_read():
    assert Recognizer().read([[0, 0], [1, 1]]) == []
    recognizer = Recognizer()
    recognizer.learn([np.array(way, float) for way in SHAPES.values()], list(SHAPES))
    assert sum(p for _, p in recognizer.read([[0, 0], [1, 0.1]])) == pytest.approx(1.0)


@pytest.mark.parametrize("bad", [[[0, 0]], [[1, 1], [1, 1]], [[0, np.nan], [1, 1]], [0, 1]])
def test_what_is_no_stroke_is_told(bad):
    recognizer = Recognizer()
    recognizer.learn([np.array(SHAPES["hook"], float)], ["hook"])
    with pytest.raises(ValueError, match="stroke"):
        recognizer.read(bad)
