# SPDX-License-Identifier: Apache-2.0
"""Writes a commented `robot.yaml` from a model and, where there is one, a recording."""

import json
import os
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import yaml

from touchline.errors import InputError
from touchline.init.contents import read_contents
from touchline.init.signals import FoundSensor, Signals, find_signals
from touchline.model.guess import (
    UNKNOWN,
    Guess,
    force_torque_links,
    guess_description,
    rest_position,
    torque_reason,
)
from touchline.model.loading import load_mechanism, read_robot_file
from touchline.model.mechanism import Mechanism
from touchline.model.packages import installed_shares
from touchline.model.plausibility import floating_warning
from touchline.model.sources import EXAMPLE_DATA, find_robot

NOTHING = Signals({}, (), False, ())
ABSENT = "the recording does not have it: write where it stood"


@dataclass(frozen=True)
class Draft:
    """A first description.

    Attributes:
        text: of the `robot.yaml`.
        statements: each guess in a sentence.
        cautions: what the model has that the method does not cover.
    """

    text: str
    statements: tuple[str, ...]
    cautions: tuple[str, ...]


def init(model: str | Path, log: str | Path | None, out: Path, overwrite: bool = False) -> Draft:
    """Write a first description of a robot; it is read again to be sure that it can be.

    Args:
        model: a URDF, MJCF or xacro, or the name of one.
        log: a recording of the robot.
        out: the new file.
        overwrite: whether a file that is there may be replaced.

    Raises:
        InputError: the model or the recording cannot be read, or `out` cannot be written.
    """
    if out.exists() and not overwrite:
        raise InputError(f"--out {out}: is there already; --overwrite replaces it")
    if out.suffix not in (".yaml", ".yml"):
        raise InputError(f"--out {out}: must end in .yaml")
    source = find_robot(model)
    if source.kind == "description":
        raise InputError(f"{model}: is a description already; init makes one from a URDF or MJCF")
    mechanism = load_mechanism(source.path)
    guess = guess_description(mechanism, source.path)
    signals = NOTHING
    if log is not None:
        signals = find_signals(read_contents(Path(log)), mechanism, guess.observed)
    draft = _draft(guess, mechanism, signals, log, out)
    _write(out, draft.text)
    return draft


def _write(out: Path, text: str) -> None:
    part = out.with_name(f".{out.stem}.part.yaml")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text, encoding="utf-8")
        read_robot_file(part)
        part.replace(out)
    except OSError as error:
        raise InputError(f"--out {out}: cannot be written: {error.strerror}") from None
    finally:
        with suppress(OSError):  # where nothing can be written, nothing is left
            part.unlink(missing_ok=True)


def _draft(
    guess: Guess, mechanism: Mechanism, signals: Signals, log: str | Path | None, out: Path
) -> Draft:
    torque, why = guess.family.torque, torque_reason(guess.family)
    if log is not None and torque != "none" and not signals.has_torque:
        torque, why = "none", "no joint torques were found in the recording"
    elif signals.currents and torque == "sensor" and guess.family is UNKNOWN:
        torque, why = "motor", "the recording has motor currents"
    if signals.absent:
        absent = {name: (rest_position(mechanism, name), ABSENT) for name in signals.absent}
        observed = tuple(name for name in guess.observed if name not in absent)
        guess = replace(guess, observed=observed, locked=guess.locked | absent)
    said = [f"joint torques are `torque: {torque}`: {why}"]
    for reason in dict.fromkeys(reason for _, reason in guess.locked.values()):
        names = ", ".join(n for n, (_, other) in guess.locked.items() if other == reason)
        said.append(f"locked: {names}: {reason}")
    said += signals.statements
    model = _portable(guess.model, out)
    parts = [
        f"# {guess.name}: what `touchline init` took from {guess.model.name}"
        + (f" and {Path(log).name}." if log is not None else "."),
        "# Comments say what was guessed; `touchline check` tells what a recording contradicts.",
        f"name: {guess.name}",
        f"model: {_quoted(model)}",
        _joints(guess, torque, why, signals.silent),
        _locked(guess),
        _sensors(signals.sensors, mechanism),
        _log(signals),
        "# noise: {qd: 2.0e-4, tau: 0.05}  # 1 sigma per sample; written by `touchline calibrate`",
        "# observer: {bandwidth: 100.0}      # rad/s; 20 for recordings at 100 Hz",
    ]
    text = "\n".join(part for part in parts if part) + "\n"
    return Draft(text, tuple(said), (*guess.cautions, *floating_warning(mechanism)))


def _portable(model: Path, out: Path) -> str:
    """Name the model as a description does: by its package if that is installed, else relative."""
    for share in installed_shares(EXAMPLE_DATA):
        if model.is_relative_to(share):
            return f"package://{EXAMPLE_DATA}/{model.relative_to(share).as_posix()}"
    return Path(os.path.relpath(model, out.parent)).as_posix()


def _joints(guess: Guess, torque: str, why: str, silent: tuple[str, ...]) -> str:
    lines = [f"joints:    # in the order of all arrays; torques: {why}"]
    for name in guess.observed:
        own = "none" if name in silent else torque
        lines.append(f"  - {{name: {_quoted(name)}, torque: {own}}}")
    return "\n".join(lines)


def _locked(guess: Guess) -> str:
    if not guess.locked:
        return ""
    lines = ["locked:    # not observed: held at this position [rad or m]"]
    lines += [
        f"  {_quoted(name)}: {position:g}    # {reason}"
        for name, (position, reason) in guess.locked.items()
    ]
    return "\n".join(lines)


def _sensors(sensors: tuple[FoundSensor, ...], mechanism: Mechanism) -> str:
    if not sensors:
        links = force_torque_links(mechanism)
        link = links[0] if links else "LINK"
        return "\n".join(
            [
                "# force_torque_sensors:    # none was found; a sensor would be written so:",
                f"#   - {{name: wrist, link: {link}, polarity: inboard}}",
            ]
        )
    lines = ["force_torque_sensors:"]
    for sensor in sensors:
        lines += [
            f"  - name: {_quoted(sensor.name)}    # {sensor.source}",
            f"    link: {_quoted(sensor.link)}    # the first link that it carries: {sensor.why}",
            "    pose: {xyz: [0, 0, 0], rpy: [0, 0, 0]}    # of its frame in that link: not known",
            "    polarity: inboard    # the load on its tool side, as most report it; see `check`",
        ]
    return "\n".join(lines)


def _log(signals: Signals) -> str:
    if not signals.log:
        return ""
    text = yaml.safe_dump(
        {"log": signals.log}, default_flow_style=None, sort_keys=False, width=90, allow_unicode=True
    )
    return "# Where the recording has each signal:\n" + text.rstrip()


def _quoted(text: str) -> str:
    plain = all(c.isalnum() or c in "_-./:" for c in text) and text[:1].isalpha()
    return text if plain and text.lower() not in ("true", "false", "null") else json.dumps(text)
