# SPDX-License-Identifier: Apache-2.0
"""The values of `robot.yaml`: each function takes what YAML holds and returns it checked.

Every one raises ValueError with the value and what is allowed. The second argument is the type,
which cattrs passes to its hooks.
"""

import math
import reprlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from touchline.model.description import AXES, Vector
from touchline.model.mechanism import Inertia
from touchline.model.plausibility import inertia_problem
from touchline.model.transforms import inertia_matrix
from touchline.model.yaml_file import kind_of
from touchline.suggest import not_allowed

TORQUES = ("sensor", "motor", "none")
METHODS = ("rows", "scaled", "chi2", "glrt", "cusum")  # of detection
MOST_WINDOW = 0.5  # s; longer ones are no detection any more
REACTIONS = ("ignore", "stop", "float", "retract")
OWN = "own:"  # begins the name of a reaction that the user's program brings

Hook = Callable[..., Any]


@dataclass(frozen=True)
class Torque:
    """Where a joint's torque comes from; `sources` are the sensors of kind "from"."""

    kind: str = "sensor"
    sources: tuple[str, ...] = ()


def number(value: Any, _: Any = None) -> float:
    """Return a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{show(value)} is not a number")
    try:
        read = float(value)
    except OverflowError:  # an integer of more than 308 digits
        read = math.inf
    if not abs(read) < math.inf:
        raise ValueError(f"{show(value)} is not a finite number")
    return read


def non_negative(value: Any, _: Any = None) -> float:
    """Return a finite number that is not negative."""
    if number(value) < 0:
        raise ValueError(f"{show(value)} is negative; allowed: 0 or more")
    return float(value)


def positive(value: Any, _: Any = None) -> float:
    """Return a finite number above 0."""
    if number(value) <= 0:
        raise ValueError(f"{show(value)} is not allowed; allowed: more than 0")
    return float(value)


def fraction(value: Any, _: Any = None) -> float:
    """Return a number above 0 and at most 1."""
    if not 0 < number(value) <= 1:
        raise ValueError(f"{value} is not allowed; allowed: above 0, at most 1")
    return float(value)


def positive_or_inf(value: Any, _: Any = None) -> float:
    """Return a number above 0; `.inf` means no limit."""
    return math.inf if value == math.inf else positive(value)


def sign(value: Any, _: Any = None) -> float:
    """Return 1 or -1."""
    if isinstance(value, bool) or value not in (1, -1):
        raise ValueError(f"{show(value)} is not allowed; allowed: 1, -1")
    return float(value)


def methods(value: Any, _: Any = None) -> tuple[str, ...]:
    """Return one or several methods of detection, each once."""
    named = list_of(one_of(*METHODS))(value) if isinstance(value, list) else (value,)
    if not named or len(set(named)) < len(named):
        raise ValueError(f"{show(value)}: name at least one method, each once")
    return tuple(one_of(*METHODS)(name) for name in named)


def windows(value: Any, _: Any = None) -> tuple[float, ...]:
    """Return the lengths of windows [s]."""
    lengths = list_of(positive)(value)
    if not 1 <= len(lengths) <= 10 or max(lengths) > MOST_WINDOW:
        raise ValueError(f"{show(value)}: allowed: 1 to 10 lengths of at most {MOST_WINDOW:g} s")
    return lengths


def text(value: Any, _: Any = None) -> str:
    """Return text that is not empty."""
    if not isinstance(value, str):
        raise ValueError(f"{show(value)} is {kind_of(value)}, not text")
    if not value.strip():
        raise ValueError("the text is empty")
    return value


def truth(value: Any, _: Any = None) -> bool:
    """Return true or false."""
    if not isinstance(value, bool):
        raise ValueError(f"{show(value)} is {kind_of(value)}; allowed: true, false")
    return value


def require_mapping(value: Any, more: str = "") -> None:
    """Raise unless it is a mapping; `more` goes on with what is allowed."""
    if not isinstance(value, dict):
        raise ValueError(f"{show(value)} is {kind_of(value)}, not a mapping{more}")


def reaction(value: Any, _: Any = None) -> str:
    """Return the name of a reaction, or `own:NAME`."""
    if isinstance(value, str) and value.startswith(OWN) and len(value) > len(OWN):
        return value
    return one_of(*REACTIONS, f"{OWN}NAME")(value) if value != f"{OWN}NAME" else value


def one_of(*allowed: str) -> Hook:
    """Return a hook that accepts one of a few words."""

    def choose(value: Any, _: Any = None) -> str:
        if not isinstance(value, str) or value not in allowed:
            raise ValueError(not_allowed(_word(value), allowed))
        return value

    return choose


def list_of(item: Hook, *counts: int) -> Hook:
    """Return a hook for a list of checked items; `counts` are the lengths allowed, () any."""

    def check(value: Any, _: Any = None) -> tuple[Any, ...]:
        if not isinstance(value, list):
            raise ValueError(f"{show(value)} is {kind_of(value)}, not a list")
        if counts and len(value) not in counts:
            wanted = " or ".join(map(str, counts))
            raise ValueError(f"{show(value)} has {len(value)} values; allowed: {wanted}")
        return tuple(item(entry) for entry in value)

    return check


def number_or_list(item: Hook) -> Hook:
    """Return a hook for one number (a float) or a list of them (a tuple)."""
    many = list_of(item)

    def check(value: Any, _: Any = None) -> float | Vector:
        return many(value) if isinstance(value, list) else item(value)

    return check


def inertia(value: Any, _: Any = None) -> Vector:
    """Return ixx, ixy, ixz, iyy, iyz, izz [kg m2] with no negative principal moment."""
    six = list_of(number, 6)(value)
    problem = inertia_problem(Inertia(1.0, np.zeros(3), inertia_matrix(six)))
    if problem and "negative" in problem:
        raise ValueError(problem)
    return six


def axes(value: Any, _: Any = None) -> tuple[str, ...]:
    """Return the measured axes, which stand in the order of AXES."""
    names = list_of(one_of(*AXES))(value)
    if not names or list(names) != sorted(set(names), key=AXES.index):
        raise ValueError(f"{show(value)}: name each axis once, in the order {', '.join(AXES)}")
    return names


def torque(value: Any, _: Any = None) -> Torque:
    """Return what `torque:` says: a word, or {from: [SENSOR, ...]}."""
    if isinstance(value, dict) and set(value) == {"from"}:
        sources = list_of(text)(value["from"])
        if not sources or len(set(sources)) < len(sources):
            raise ValueError(f"from: {show(value['from'])}: name at least one sensor, each once")
        return Torque("from", sources)
    if not isinstance(value, str) or value not in TORQUES:
        allowed = [*TORQUES, "{from: [SENSOR, ...]}"]
        raise ValueError(not_allowed(_word(value), allowed))
    return Torque(value)


def show(value: Any) -> str:
    """Return the value as short text."""
    return reprlib.repr(value)


def _word(value: Any) -> str:
    return value if isinstance(value, str) else show(value)
