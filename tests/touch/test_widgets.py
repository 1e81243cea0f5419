# SPDX-License-Identifier: Apache-2.0
"""Widgets: what a place on a link says of a button, a slider, a dial and a pad."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from touchline.errors import InputError
from touchline.model.description import WidgetDescription
from touchline.touch.widget import Widget

UP = (0.0, 0.0, 1.0)
coordinates = st.floats(-0.05, 0.05)


def test_a_button_holds_what_lies_within_its_radius():
    button = Widget("b", WidgetDescription("button", "link", at=(0.1, 0.0, 0.0), radius=0.02))
    assert button.read(np.array([0.1, 0.015, 0.0])).beyond == pytest.approx(-0.005)
    assert button.read(np.array([0.1, 0.03, 0.0])).beyond == pytest.approx(0.01)


def test_a_button_without_a_place_is_the_whole_link():
    assert Widget("b", WidgetDescription("button", "link")).probability(np.zeros(3), 1.0) == 1.0


@given(st.floats(0.001, 0.02))
def test_on_the_rim_it_is_a_toss_up(std):
    button = Widget("b", WidgetDescription("button", "link", at=(0.0, 0.0, 0.0), radius=0.02))
    assert button.probability(np.array([0.02, 0.0, 0.0]), std) == pytest.approx(0.5)


@given(st.floats(0.0, 1.0), st.floats(-0.01, 0.01))
def test_a_slider_reads_the_part_of_its_way(value, aside):
    path = ((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.1, 0.05, 0.0))
    given_ = WidgetDescription("slider", "link", path=path, width=0.03, range=(10.0, 20.0))
    slider = Widget("s", given_)
    assert slider.length == pytest.approx(0.15)
    reading = slider.read(slider.point_at(value) + [0.0, 0.0, aside])
    assert reading.value == pytest.approx(value, abs=1e-9)
    assert reading.beyond == pytest.approx(abs(aside) - 0.015)
    assert slider.scaled(reading.value) == pytest.approx(10 + 10 * value)


@given(coordinates, coordinates)
def test_a_pad_is_seen_from_outside_u_to_the_right_v_up(u, v):
    given_ = WidgetDescription("pad", "l", at=(0.0, 0.1, 0.0), up=UP, size=(0.1, 0.1))
    pad = Widget("p", given_, normal=np.array([0.0, 1.0, 0.0]))
    right, up, out = pad.plane()
    # Who looks along -y with z upwards has -x on the right hand.
    assert right == pytest.approx([-1.0, 0.0, 0.0])
    assert np.cross(right, up) == pytest.approx(out)
    place = np.array([0.0, 0.1, 0.0]) + u * right + v * up
    assert pad.read(place).value == pytest.approx((u, v))
    assert pad.read(place).beyond <= 1e-12


def test_a_dial_turns_by_the_angle_of_the_finger():
    given_ = WidgetDescription("dial", "l", at=(0.0, 0.0, 0.0), normal=UP, radius=0.03)
    dial = Widget("d", given_)
    u, v, _ = dial.plane()
    angles = [dial.read(0.02 * (np.cos(a) * u + np.sin(a) * v)).value for a in (0.0, 1.0)]
    assert angles[1] - angles[0] == pytest.approx(1.0)


def test_a_pad_that_stands_on_the_surface_is_told():
    given_ = WidgetDescription("pad", "l", at=(0.0, 0.1, 0.0), up=UP, size=(0.1, 0.1))
    with pytest.raises(InputError, match=r"interface\.p\.up"):
        Widget("p", given_, normal=np.array(UP))
