# SPDX-License-Identifier: Apache-2.0
"""Whatever stands in the files: they are read, or one InputError says what is wrong."""

import copy
import random

import pytest
import yaml

from touchline.errors import InputError
from touchline.model.loading import load_mechanism, read_robot_file

MORE = """
noise: {q: 1, wrist: [1, 2, 3, 4, 5, 6]}
observer: {bandwidth: {joints: [1, 2], wrist: 3}}
loads: [{link: hand, mass: 1, com: [0, 0, 0], inertia: [1, 0, 0, 1, 0, 1]}]
links: {hand: {mass: 1}}
gravity: [0, 0, 1]
package_dirs: [.]
"""
NAN = float("nan")
VALUES = [None, -1, 1.5, NAN, 10**400, True, "", "wrist", "\0", "robot:", "package://", "/"]
VALUES += [
    [],
    {},
    [1],
    [None],
    [[1]],
    {1: 2},
    {"from": [1]},
    {"name": None},
    [{"name": "wrist"}] * 2,
]


def places(data, where=()):
    """Yield the path to each value below `data`."""
    keys = data if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
    for key in keys:
        yield (*where, key)
        yield from places(data[key], (*where, key))


def spoil(data, chance):
    """Replace, remove or rename a few values."""
    for _ in range(chance.choice([1, 1, 2, 5])):
        *outer, last = chance.choice(list(places(data)) or [("name",)])
        holder = data
        for key in outer:
            holder = holder[key]
        if chance.random() < 0.7:
            holder[last] = copy.deepcopy(chance.choice(VALUES))
        elif isinstance(holder, dict):
            holder[chance.choice(["x", 1, "mass"])] = holder.pop(last, 0)
        else:
            del holder[last]


@pytest.mark.parametrize("seed", range(4))
def test_spoiled_descriptions(folder, seed):
    path, chance, refused = folder / "robot.yaml", random.Random(seed), 0
    whole = yaml.safe_load(path.read_text() + MORE)
    for _ in range(40):
        data = copy.deepcopy(whole)
        spoil(data, chance)
        path.write_text(yaml.safe_dump(data))
        try:
            read_robot_file(path)
        except InputError as error:
            refused += 1
            assert error.problems
            assert all(line.startswith(str(folder)) for line in error.problems)
    assert refused > 20


def test_spoiled_models(folder):
    path, chance, refused = folder / "arm.urdf", random.Random(1), 0
    whole = path.read_text()
    for _ in range(200):
        start = chance.randrange(len(whole))
        patch = chance.choice(["", "nan", "<link name='q'/>", whole[start // 2 :][:20]])
        path.write_text(whole[:start] + patch + whole[start + chance.randrange(30) :])
        try:
            load_mechanism(path)
        except InputError as error:
            refused += 1
            assert error.problems
    assert refused > 100
