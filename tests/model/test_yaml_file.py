# SPDX-License-Identifier: Apache-2.0
import math

import pytest

from touchline.errors import InputError
from touchline.model.yaml_file import read_yaml


def read(tmp_path, text):
    path = tmp_path / "robot.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_yaml(path)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 1e-3),
        ("-1E+3", -1000.0),
        ("+.5", 0.5),
        ("1.", 1.0),
        ("2.0e-4", 2e-4),
        (".inf", math.inf),
        ("-.INF", -math.inf),
        ("010", 10),
        ("0o10", 8),
        ("0x1F", 31),
        ("-7", -7),
        ("1:30", "1:30"),
        ("1_000", "1_000"),
        ("2024-01-01", "2024-01-01"),
        ("on", "on"),
        ("No", "No"),
        ("True", True),
        ("~", None),
        ("'1'", "1"),
        ("1e", "1e"),
        (".", "."),
        ("9" * 5000, math.inf),
    ],
)
def test_scalars_are_yaml_1_2(tmp_path, text, value):
    found = read(tmp_path, f"key: {text}\n")["key"]
    assert found == value
    assert type(found) is type(value)


def test_not_a_number_is_one(tmp_path):
    assert math.isnan(read(tmp_path, "key: .nan")["key"])


def test_merge_keys_and_aliases_work(tmp_path):
    data = read(tmp_path, "a: &a {x: 1, y: 2}\nb: {<<: *a, y: 3}\n")
    assert data["b"] == {"x": 1, "y": 3}


def test_every_repeated_key_is_named_with_its_line(tmp_path):
    with pytest.raises(InputError) as error:
        read(tmp_path, "a: 1\nb: {c: 1,\n    c: 2}\nlist:\n  - {d: 1, d: 1}\na: 2\n")
    first, second, third = sorted(error.value.problems)
    assert "robot.yaml:3: the key 'c' stands twice (first in line 2)" in first
    assert "robot.yaml:5: the key 'd'" in second
    assert "robot.yaml:6: the key 'a' stands twice (first in line 1)" in third


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [1, 2\nb: 3\n", r"robot\.yaml:2:\d+: not valid YAML: "),
        ("a: b: c\n", r"robot\.yaml:1:\d+: not valid YAML: "),
        ("a: !!python/object:os.system x\n", r"robot\.yaml:1:4: not valid YAML: .*constructor"),
        ("a: *missing\n", r"robot\.yaml:1:4: .*undefined alias"),
        ("a: 1\n---\nb: 2\n", r"robot\.yaml:2:1: .*another document"),
        ("", r"the file is empty"),
        ("# nothing\n", r"the file is empty"),
        ("- 1\n", r"holds a list, not a mapping"),
        ("just text", r"holds text, not a mapping"),
        (b"a: \xff\xfe", r"not a text file"),
        (b"a: \x00", r"robot\.yaml: not valid YAML"),
    ],
)
def test_broken_files(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path, text)


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(InputError, match=r"gone\.yaml: no such file"):
        read_yaml(tmp_path / "gone.yaml")
    with pytest.raises(InputError, match="cannot be read"):
        read_yaml(tmp_path)


@pytest.mark.parametrize(
    "text",
    [
        "a: " + "[" * 5000 + "]" * 5000,
        "a: " + "{b: " * 5000 + "}" * 5000,
        "a: " + "[" * 5000,
        "- " * 5000 + "x",
        "\n".join(" " * i + "a:" for i in range(1500)),
    ],
    ids=["lists", "mappings", "unclosed", "dashes", "indented"],
)
def test_what_is_nested_too_deeply_is_refused(tmp_path, text):
    with pytest.raises(InputError, match=r"robot.yaml:\d+:\d+: more than 50 mappings and lists"):
        read(tmp_path, text)
