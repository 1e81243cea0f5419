# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a widget of `interface` is told with its key."""

import pytest
import yaml

import touchline as tl
from touchline.model.yaml_file import read_yaml

BUTTON = {"kind": "button", "link": "link4", "at": [0.0, 0.1, 0.0], "radius": 0.02}
SLIDER = {"kind": "slider", "link": "link4", "path": [[0, 0, 0], [0.1, 0, 0]]}


def load(folder, name, widget):
    given = read_yaml(tl.load_robot("sara").description.path)
    path = folder / "arm.yaml"
    path.write_text(yaml.safe_dump(given | {"model": "robot:sara", "interface": {name: widget}}))
    return tl.load_robot(path)


@pytest.mark.parametrize(
    ("name", "widget", "words"),
    [
        ("tap", BUTTON, "interface.tap: 'tap' is the name of a gesture"),
        ("a", BUTTON | {"link": "link44"}, "interface.a.link: unknown link 'link44'"),
        ("a", {"kind": "button"}, "interface.a: a button needs link and at and radius"),
        ("a", {"kind": "toggle", "link": "link4", "radius": 0.02}, "a toggle needs at"),
        ("a", {"kind": "slider", "link": "link4"}, "interface.a: a slider needs path"),
        ("a", SLIDER | {"path": [[0, 0, 0]]}, "interface.a.path: has 1 point; allowed: 2 or more"),
        (
            "a",
            {"kind": "dial", "link": "link4", "at": [0, 0, 0], "radius": 0.03, "normal": [0, 0, 0]},
            "interface.a.normal: is the zero vector",
        ),
        ("a", BUTTON | {"force": 50.0}, "interface.a.most: 40 is not above force, 50"),
        (
            "a",
            {"kind": "button", "taught": [{"q": [0.0] * 7, "step": [1.0] * 6}]},
            "interface.a.taught[0].step: has 6 values; allowed: one for each of the 7 joints",
        ),
    ],
)
def test_a_widget_that_cannot_be_is_told(tmp_path, name, widget, words):
    with pytest.raises(tl.InputError) as caught:
        load(tmp_path, name, widget)
    assert words in str(caught.value)


def test_widgets_without_places_are_whole_links_or_taught(tmp_path):
    robot = load(tmp_path, "a", {"kind": "button", "link": "link4"})
    assert robot.description.interface["a"].at is None
    touch = {"q": [0.0] * 7, "step": [1.0] * 7}
    robot = load(tmp_path, "a", {"kind": "toggle", "taught": [touch]})
    assert len(robot.description.interface["a"].taught) == 1
