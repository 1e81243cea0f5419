# SPDX-License-Identifier: Apache-2.0
"""Six gestures and collisions on a simulated arm: which are told, and when."""

import sys
from collections.abc import Callable

import numpy as np
from tqdm import tqdm

from touchline.bench.interface.arms import LINKS, PERIOD, arm
from touchline.bench.tables import Row
from touchline.localizer.skin import Patch, Skin
from touchline.model.description import WidgetDescription
from touchline.trials.finger import (
    Finger,
    find_pad,
    middle_of,
    press,
    sliding,
    times,
)

Made = tuple[list[Finger], float] | None  # fingers, and when the gesture ends [s]


def gestures(runs: int, rng: np.random.Generator) -> list[Row]:
    """Each gesture `runs` times, collisions three times as often on a button; with a sum."""
    rows: list[Row] = []
    total = 0
    for kind, make in GESTURES.items():
        count = 3 * runs if kind == "collision" else runs
        right = wrong = 0
        delays: list[float] = []
        for number in tqdm(range(count), file=sys.stderr, leave=False, disable=None):
            told, end = _one(kind, make, number, rng)
            expected = [] if kind == "collision" else [kind]
            right += [name for name, _ in told] == expected
            wrong += any(name not in expected for name, _ in told)
            delays += [time - end for name, time in told if name == kind]
        missed = count - right - wrong
        rows.append((kind, f"{right}/{count}", str(wrong), str(missed), times(delays)))
        total += right if kind != "collision" else 0
    share = f"{total}/{runs * (len(GESTURES) - 1)}"
    rows.insert(-1, ("all six", share, "", "", ""))
    return rows


def _one(kind: str, make, number: int, rng) -> tuple[list[tuple[str, float]], float]:
    """What was told, with times, of one gesture; and when it ended [s]."""
    touched = arm(number)
    width = 0.07 if kind == "swipe" else 0.01
    time = np.arange(0.0, 3.2, PERIOD)
    made = None
    while made is None:
        q, patch, given = find_pad(touched.skin, LINKS, width, 0.01, rng)
        made = make(touched.skin, patch, given, time, rng)
    fingers, end = made
    widgets = {}
    if kind == "collision":
        widgets["stop"] = WidgetDescription("button", patch.link, at=given.at, radius=0.03)
    _, events = touched.feel(widgets, fingers, q, time, rng)
    return [(event.kind, event.time) for event in events], end


def _pressing(lengths: Callable) -> Callable[..., Made]:
    def make(skin: Skin, patch: Patch, given, time, rng) -> Made:
        point, normal = middle_of(patch, given)
        force, begin, fingers = rng.uniform(4.0, 15.0), 0.5, []
        for length, pause in lengths(rng):
            fingers.append(press(point, normal, patch.link, time, begin, begin + length, force))
            end, begin = begin + length, begin + length + pause
        return fingers, end

    return make


def _swipe(skin: Skin, patch: Patch, given, time, rng) -> Made:
    half, length = rng.uniform(0.025, 0.033), rng.uniform(0.3, 0.8)
    way = np.outer([-half, half], [1.0, 0.0])
    force = np.full(len(time), rng.uniform(4.0, 15.0))
    finger = sliding(patch, given, way, time, 0.5, 0.5 + length, force, 0.3)
    return None if finger is None else ([finger], 0.5 + length)


def _grab(skin: Skin, patch: Patch, given, time, rng) -> Made:
    """Thumb, and a moment later the fingers on the other side of the link, not quite opposite.

    Two forces on one line that cancel leave nothing that a sensor could feel.
    """
    point, normal = middle_of(patch, given)
    R, p = patch.T_node_link[:3, :3], patch.T_node_link[:3, 3]
    beside = point + rng.uniform(0.01, 0.03) * np.array(given.up)
    rows = [r for r in patch.mesh.crossings(R @ beside + p, -(R @ normal)) if r[0] > 0.02]
    if not rows:
        return None
    last = max(rows, key=lambda row: row[0])
    outward = R.T @ np.array(last[2:5])
    if outward @ normal > -0.8:
        return None
    force, end = rng.uniform(8.0, 20.0), 0.5 + rng.uniform(0.8, 1.6)
    back = beside - float(last[0]) * normal
    late = 0.5 + rng.uniform(0.04, 0.12)
    return [
        press(point, normal, patch.link, time, 0.5, end, force),
        press(back, outward, patch.link, time, late, end, 0.6 * force),
    ], late


def _collision(skin: Skin, patch: Patch, given, time, rng) -> Made:
    point, normal = middle_of(patch, given)
    length, peak = rng.uniform(0.01, 0.05), rng.uniform(80.0, 300.0)
    part = np.clip((time - 0.5) / length, 0.0, 1.0)
    size = (peak * np.sin(np.pi * part))[:, None]
    finger = Finger(patch.link, np.tile(point, (len(time), 1)), -size * normal)
    return [finger], 0.5


GESTURES: dict[str, Callable[..., Made]] = {
    "tap": _pressing(lambda rng: [(rng.uniform(0.1, 0.22), 0.0)]),
    "double_tap": _pressing(
        lambda rng: [(rng.uniform(0.1, 0.2), rng.uniform(0.08, 0.2)), (rng.uniform(0.1, 0.2), 0.0)]
    ),
    "hold": _pressing(lambda rng: [(rng.uniform(1.2, 2.0), 0.0)]),
    "push": _pressing(lambda rng: [(rng.uniform(0.4, 0.85), 0.0)]),
    "grab": _grab,
    "swipe": _swipe,
    "collision": _collision,
}
