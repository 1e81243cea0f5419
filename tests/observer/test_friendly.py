"""Names instead of robots, and what a notebook shows."""

import pytest

import touchline as tl


def test_names_stand_for_robots():
    assert tl.Pipeline("sara").robot.name == "sara"
    with pytest.raises(tl.InputError, match="did you mean 'sara'"):
        tl.Pipeline("sarah")


def test_a_notebook_shows_the_bodies():
    html = tl.load_robot("sara")._repr_html_()
    assert "<td>link3</td><td>base</td>" in html and "&lt;Robot sara" in html
