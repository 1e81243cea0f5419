# SPDX-License-Identifier: Apache-2.0
"""Curves of a replay on its page: those that belong together, around the time that is shown."""

from dataclasses import dataclass

import numpy as np
import viser
from viser import uplot

from touchline.arrays import Array
from touchline.figure import X, Y, Z
from touchline.model.robot import Robot
from touchline.view.replay import Replay

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8d7cc0", "#7f868d", "#56b4e9", "#a6761d")
AXES = {"x": X, "y": Y, "z": Z}
NOW = "#7f868d"
ON_SEGMENT = "{}: wrench on the segment"
JOINTS = "external joint torques"
PIECES = 240  # of time in a plot
PADDING = (10, 24, 0, 0)  # pixels: top, right, bottom, left
NO_DATA = "#d9dce1"  # of gaps
GAP = 5.0  # periods without a value that are shown as a gap
LEFT_OF_NOW = 0.7  # part of the window


@dataclass(frozen=True)
class SignalGroup:
    """Curves in one plot: `unit` of all, `names` on the plot, `columns` of the estimates."""

    unit: str
    names: tuple[str, ...]
    columns: tuple[str, ...]


def signal_groups(robot: Robot, signals: tuple[str, ...]) -> dict[str, SignalGroup]:
    """What there is to choose from, by the words for it."""
    groups: dict[str, SignalGroup] = {}
    for segment in robot.segment_names:
        _add_wrench(groups, ON_SEGMENT.format(segment), f"{segment}.seg", signals)
    joints = [name for name in robot.joint_names if f"tau_ext.{name}" in signals]
    columns = tuple(f"tau_ext.{name}" for name in joints)
    groups[JOINTS] = SignalGroup("Nm", tuple(joints), columns)
    for name in joints:
        groups[torque_of(name)] = SignalGroup("Nm", (name,), (f"tau_ext.{name}",))
    for sensor in robot.sensor_names:
        _add_wrench(groups, f"{sensor}: wrench on all outboard", f"{sensor}.ext", signals)
    return groups


def force_on(segment: str) -> str:
    """The words for the force on a segment."""
    return f"{ON_SEGMENT.format(segment)}, force"


def torque_of(joint: str) -> str:
    """The words for the external torque of one joint."""
    return f"external torque of {joint}"


def _add_wrench(
    groups: dict[str, SignalGroup], words: str, prefix: str, signals: tuple[str, ...]
) -> None:
    for kind, unit in (("f", "N"), ("m", "Nm")):
        names = tuple(f"{kind}{axis}" for axis in "xyz")
        columns = tuple(f"{prefix}.{name}" for name in names)
        if all(column in signals for column in columns) and not prefix.startswith("root."):
            groups[f"{words}, {'force' if kind == 'f' else 'moment'}"] = SignalGroup(
                unit, names, columns
            )


@dataclass(frozen=True)
class Box:
    """What a plot shows: from `left` to `right`, from `low` to `high`."""

    left: float
    right: float
    low: float
    high: float


def window_around(replay: Replay, time: float, length: float | None) -> tuple[float, float]:
    """The piece of time that is shown: `length` [s] around `time`, or all for None."""
    whole = replay.end - replay.start
    if length is None or length >= whole:
        return replay.start, max(replay.end, replay.start + 1e-3)
    begin = min(max(time - LEFT_OF_NOW * length, replay.start), replay.end - length)
    return begin, begin + length


def gaps(times: Array, values: Array, least: float) -> Array:
    """Where (N,) no value of any row (R, N) is known for longer than `least`, in `times` (N,)."""
    known = np.append(np.isfinite(values).any(axis=0), True)
    edges = np.flatnonzero(np.diff(known, prepend=True))
    found = np.zeros(len(times), dtype=bool)
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        found[begin:end] = times[end - 1] - times[begin] > least
    return found


def with_now(times: Array, values: Array, now: float, box: Box) -> tuple[Array, ...]:
    """Data of a plot: times, rows of values, and an upright line at `now`.

    uPlot has no gaps and finds no range where there is a NaN: a value that is missing is the one
    before it, and the line runs along the lower border and up at `now`.

    Args:
        times: (N,) that increase.
        values: (R, N).
        now: where the line is, in the unit of `times`.
        box: what the plot shows.
    """
    at = int(np.searchsorted(times, now))
    x = np.insert(times, at, [now, now, now])
    known = _held(values)
    here = known[:, [min(at, known.shape[1] - 1)]]
    rows = np.insert(known, [at], np.repeat(here, 3, axis=1), axis=1)
    line = np.full(len(x), box.low)
    line[at + 1] = box.high
    return (x, *rows, line)


def _held(values: Array) -> Array:
    """Rows (R, N) in which NaN is the number before it, or 0 where there is none."""
    known = np.isfinite(values)
    last = np.maximum.accumulate(np.where(known, np.arange(values.shape[1]), 0), axis=1)
    return np.nan_to_num(np.take_along_axis(values, last, axis=1), nan=0.0)


def now_series() -> uplot.Series:
    """The upright line of `with_now`."""
    points = uplot.Series_Points(show=False)
    return uplot.Series(label="now", stroke=NOW, width=1.5, points=points)


def nice_range(values: Array, before: tuple[float, float] | None) -> tuple[float, float]:
    """A vertical range that holds zero and all finite values (N,), and rarely changes.

    Args:
        values: that are shown.
        before: the range that was shown.
    """
    finite = values[np.isfinite(values)]
    low, high = min(finite.min(initial=0.0), 0.0), max(finite.max(initial=0.0), 0.0)
    if before and before[0] <= low and high <= before[1] and high - low > 0.3 * np.ptp(before):
        return before
    size = max(high - low, 1e-3)
    power = 10.0 ** np.floor(np.log10(size))
    step = 0.2 * power * next(m for m in (1, 2, 5, 10) if m * power >= size)
    return float(np.floor(low / step - 0.05) * step), float(np.ceil(high / step + 0.05) * step)


class SignalPlot:
    """One plot on the page, with the choice of what it shows.

    Args:
        gui: of the page, in the place where the plot is to be.
        replay: that is shown.
        origin: from where times count on the page [s].
        groups: to choose from.
        chosen: the one that is shown first.
    """

    HEIGHT = 230

    def __init__(
        self,
        gui: viser.GuiApi,
        replay: Replay,
        origin: float,
        groups: dict[str, SignalGroup],
        chosen: str,
    ) -> None:
        self._gui, self._replay, self._origin, self._groups = gui, replay, origin, groups
        self._choice = gui.add_dropdown("curves", tuple(groups), initial_value=chosen)
        self._place = gui.add_folder("")
        self._handle: viser.GuiUplotHandle | None = None
        self._group: SignalGroup | None = None
        self._range: tuple[float, float] | None = None
        self._shown: tuple = ()

    @property
    def chosen(self) -> str:
        """What is shown."""
        return str(self._choice.value)

    def choose(self, *names: str) -> None:
        """Shows another group: the first of the names that there is."""
        for name in names:
            if name in self._groups:
                self._choice.value = name
                return

    def update(self, now: float, length: float | None) -> None:
        """Shows what is chosen around a time.

        Args:
            now: the time [s] that is marked.
            length: of the time shown [s]; None: all.
        """
        group = self._groups[self.chosen]
        begin, end = window_around(self._replay, now, length)
        if (group, begin, end, now) == self._shown:
            return
        self._shown = (group, begin, end, now)
        step = (end - begin) / PIECES
        begin = np.floor(begin / step) * step  # pieces that stand still while the window moves
        found = [
            self._replay.curve(c, begin, begin + step * (PIECES + 1), PIECES + 1)
            for c in group.columns
        ]
        times, values = found[0][0] - self._origin, np.array([values for _, values in found])
        same = self._handle is not None and group is self._group
        low, high = nice_range(values, self._range if same else None)
        box = Box(times[0], times[-1], low, high)
        heights = np.where(gaps(times, values, GAP * self._replay.origin.period), high, low)
        data = with_now(times, np.vstack([values, heights]), now - self._origin, box)
        if self._handle is not None and same:
            if self._range != (low, high):
                self._handle.series = _series(group, low)
            self._handle.data = data
        else:
            self._make(group, data, low)
        self._group, self._range = group, (low, high)

    def _make(self, group: SignalGroup, data: tuple[Array, ...], low: float) -> None:
        """A new plot: one that changed its curves would keep the time that it showed."""
        if self._handle is not None:
            self._handle.remove()
        axes = (uplot.Axis(), uplot.Axis(label=group.unit, labelSize=18, size=52))
        with self._place:
            self._handle = self._gui.add_uplot(
                data,
                _series(group, low),
                scales={"x": uplot.Scale(time=False)},
                axes=axes,
                height=self.HEIGHT,
                padding=PADDING,
            )


def _series(group: SignalGroup, low: float) -> tuple[uplot.Series, ...]:
    """Of the curves, of what fills gaps from the lower border `low` on, and of the time shown."""
    points = uplot.Series_Points(show=False)
    curves = [
        uplot.Series(label=name, stroke=colour_of(name, i), width=1.5, points=points)
        for i, name in enumerate(group.names)
    ]
    nothing = uplot.Series(label="no data", width=0, fill=NO_DATA, fillTo=low, points=points)
    return (uplot.Series(label="time [s]"), *curves, nothing, now_series())


def colour_of(name: str, number: int) -> str:
    """That of the axis for fx to mz, else one by its number."""
    if len(name) == 2 and name[0] in "fm" and name[1] in AXES:
        return AXES[name[1]]
    return COLOURS[number % len(COLOURS)]
