# SPDX-License-Identifier: Apache-2.0
"""Buttons and sliders on a simulated arm."""

import sys

import numpy as np
from tqdm import tqdm

from touchline.arrays import Array
from touchline.bench.interface.arms import LINKS, PERIOD, arm
from touchline.bench.tables import Row
from touchline.localizer.skin import Skin
from touchline.model.description import WidgetDescription
from touchline.touch.widget import Widget
from touchline.trials.finger import (
    Finger,
    find_pad,
    middle_of,
    press,
    project,
    reaching,
    sliding,
    times,
)

RADIUS = 0.02  # m, of a button
GAPS = {"3 cm between rims": 0.07, "1 cm between rims": 0.05}  # m, between two middles
AIM = 0.01  # m; a finger lands within this distance of a button's middle
LEAST, HARDEST = 3.0, 15.0  # N
SLIDER = 0.15  # m
APART = 0.1  # m, at least, from the hand that holds the arm to the slider


def buttons(runs: int, rng: np.random.Generator) -> list[Row]:
    """Presses of one of two buttons."""
    rows: list[Row] = []
    for name, gap in GAPS.items():
        right = wrong = 0
        delays: list[float] = []
        for number in tqdm(range(runs), file=sys.stderr, leave=False, disable=None):
            told, delay = _button(gap, number, rng)
            right += told == ["one"]
            wrong += any(widget != "one" for widget in told)
            delays += delay
        missed = str(runs - right - wrong)
        rows.append((f"button, {name}", f"{right}/{runs}", str(wrong), missed, times(delays)))
    return rows


def _button(gap: float, number: int, rng) -> tuple[list[str | None], list[float]]:
    touched = arm(number)
    placed = pressed = None
    while placed is None or pressed is None:
        q, patch, given = find_pad(touched.skin, LINKS, gap + 2 * AIM, 2 * AIM, rng)
        placed = project(patch, given, np.array([[-gap / 2, 0.0], [gap / 2, 0.0]]))
        angle, distance = rng.uniform(0, 2 * np.pi), AIM * np.sqrt(rng.uniform())
        spot = distance * np.array([np.cos(angle), np.sin(angle)]) + [-gap / 2, 0.0]
        pressed = project(patch, given, spot[None])
    widgets = {
        name: WidgetDescription("button", patch.link, at=tuple(at), radius=RADIUS)
        for name, at in zip(("one", "two"), placed[0], strict=True)
    }
    time, force = np.arange(0.0, 1.2, PERIOD), rng.uniform(LEAST, HARDEST)
    end = 0.5 + rng.uniform(0.2, 0.5)
    finger = press(pressed[0][0], pressed[1][0], patch.link, time, 0.5, end, force)
    _, events = touched.feel(widgets, [finger], q, time, rng)
    named = [event for event in events if event.kind == "press"]
    reached = 0.5 + reaching(LEAST / force)
    return [event.widget for event in named], [event.time - reached for event in named[:1]]


def sliders(runs: int, rng: np.random.Generator) -> list[Row]:
    """How far a slider's value is from the finger, alone and while a hand holds the arm."""
    rows: list[Row] = []
    for name, held in (("slider", False), ("slider, another hand holds the arm", True)):
        off: list[float] = []
        followed = 0
        for number in tqdm(range(runs), file=sys.stderr, leave=False, disable=None):
            found = _slider(held, number, rng)
            followed += len(found) > 0
            off += found
        share = (
            f"{1e3 * np.quantile(off, 0.5):.1f}, {1e3 * np.quantile(off, 0.95):.1f} mm"
            if off
            else "-"
        )
        rows.append((name, f"{followed}/{runs}", share))
    return rows


def _slider(held: bool, number: int, rng) -> list[float]:
    """Distances [m] between what a slider tells and where the finger is, at each change."""
    touched = arm(number)
    time = np.arange(0.0, 4.0, PERIOD)
    begin, length = 1.2, rng.uniform(1.0, 2.2)
    way = np.array([[-SLIDER / 2, 0.0], [SLIDER / 2, 0.0]])
    hand = placed = finger = None
    while placed is None or finger is None or (held and hand is None):
        q, patch, given = find_pad(touched.skin, LINKS, SLIDER, 0.01, rng)
        placed = project(patch, given, np.linspace(way[0], way[1], 7))
        force = np.full(len(time), rng.uniform(4.0, 12.0))
        finger = sliding(patch, given, way, time, begin, begin + length, force, 0.3)
        if held and finger is not None:
            hand = _holding(touched.skin, q, finger, time, rng)
    fingers = [finger] if hand is None else [hand, finger]
    path = tuple(tuple(float(x) for x in corner) for corner in placed[0])
    slider = WidgetDescription("slider", patch.link, path=path, width=0.03)
    _, events = touched.feel({"speed": slider}, fingers, q, time, rng)
    widget = Widget("speed", slider)
    off = []
    for event in events:
        if event.kind == "change":
            row = min(int(np.searchsorted(time, event.time)), len(time) - 1)
            true = widget.read(finger.point[row]).value
            assert isinstance(true, float)
            off.append(abs(event.value - true) * widget.length)
    return off


def _holding(skin: Skin, q: Array, finger: Finger, time: Array, rng) -> Finger | None:
    """A hand that holds the arm elsewhere, from before to after the finger."""
    poses = skin.robot.poses(q)
    on = next(patch for patch in skin.patches if patch.link == finger.link)
    T = poses[on.node] @ on.T_node_link
    way = finger.point @ T[:3, :3].T + T[:3, 3]
    for _ in range(50):
        _, patch, given = find_pad(skin, LINKS, 0.01, 0.01, rng, q)
        point, normal = middle_of(patch, given)
        T = poses[patch.node] @ patch.T_node_link
        place = T[:3, :3] @ point + T[:3, 3]
        if np.linalg.norm(way - place, axis=1).min() > APART:
            force = rng.uniform(8.0, 20.0)
            return press(point, normal, patch.link, time, 0.4, 3.8, force)
    return None
