# SPDX-License-Identifier: Apache-2.0
"""`--help` reads well: the terminal breaks lines, and a default stands where it tells something."""

from pathlib import Path
from typing import Literal

import pytest

from touchline.cli import main
from touchline.cli.explained import default_hint, explanation, for_help, type_text
from touchline.cli.main import COMMANDS


def weigh(
    log: Path,
    /,
    unit: Literal["kg", "N"] = "kg",
    seconds: float = 3.0,
    limit: float | None = None,
    quiet: bool = False,
    names: tuple[str, ...] = (),
) -> int:
    """Weighs what the arm carries.

    Example: touchline weigh run.parquet

    It takes some seconds
    (of motion).

    Args:
        log: The recording
            (a table).
        unit: What to tell.
        seconds: Length of the motion [s].
        limit: Largest mass. Default: that of the arm.
        quiet: Prints nothing.
        names: Links that may carry it.
    """
    return int(seconds)


def test_a_docstring_is_taken_apart():
    told = explanation(weigh)
    assert told.about[2] == "It takes some seconds (of motion)."
    assert told.meanings["log"] == "The recording (a table)."
    assert list(told.meanings) == ["log", "unit", "seconds", "limit", "quiet", "names"]


def test_the_copy_for_help_does_the_same():
    copy = for_help(weigh)
    assert copy(Path("x"), seconds=5.0) == 5
    assert "(of motion)" in (copy.__doc__ or "")


@pytest.mark.parametrize(
    ("default", "meaning", "hint"),
    [
        (None, "Mass.", ""),
        (False, "Quiet.", ""),
        ((), "Links.", ""),
        (0, "Processes. Default: one per core.", ""),
        (True, "Page.", "(default: yes)"),
        (3.0, "Length.", "(default: 3)"),
        (("a", "b"), "Arms.", "(default: a b)"),
    ],
)
def test_defaults_that_tell_something(default, meaning, hint):
    assert default_hint(default, meaning) == hint


@pytest.mark.parametrize(
    ("hint", "text"),
    [
        (bool, "yes or no"),
        (float | None, "number"),
        (Literal["kg", "N"], "kg or N"),
        (tuple[Literal[0, 1, 2], ...], "several: 0, 1 or 2"),
    ],
)
def test_types_in_words(hint, text):
    assert type_text(hint) == text


@pytest.mark.parametrize("name", [name for name in COMMANDS if name != "bench"])
def test_help_has_no_default_that_tells_nothing(name, capsys):
    assert main([name, "--help"]) == 0
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    for nothing in ("default: None", "default: False", "default: )", "inspect._empty", "{None}"):
        assert nothing not in text


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["check"], "Missing from touchline check: ROBOT"),
        (["reproduce", "fig9"], "invalid choice 'fig9'"),
        (["simulate", "sara", "--out", "o", "--seconds", "x"], "--seconds takes a number, not 'x'"),
        (
            ["simulate", "sara", "--out", "o", "--seed", "1.5"],
            "--seed takes a whole number, not '1.5'",
        ),
        (["analyze", "a", "--robt", "sara", "--out", "o"], "Perhaps you meant: --robot"),
        (["analyze", "a", "--out", "o", "--workers", "two"], "--workers takes a whole number"),
    ],
)
def test_arguments_that_cannot_be_understood_are_told_in_one_line(arguments, words, capsys):
    assert main(arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line and line.endswith(f"see touchline {arguments[0]} --help")
    assert "---" not in line and "full helptext" not in line
