# SPDX-License-Identifier: Apache-2.0
"""Curves of a replay on its page: those that belong together, around the time that is shown."""

from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import NDArray

from touchline.model.robot import Robot
from touchline.view.replay import Replay

Array = NDArray[np.float64]

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#6a51a3", "#444444", "#56b4e9", "#a6761d")
NOW = "#22262b"
PIECES = 240  # of time in a plot
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
        _add_wrench(groups, f"{segment}: wrench on the segment", f"{segment}.seg", signals)
    joints = [name for name in robot.joint_names if f"tau_ext.{name}" in signals]
    columns = tuple(f"tau_ext.{name}" for name in joints)
    groups["external joint torques"] = SignalGroup("Nm", tuple(joints), columns)
    for name in joints:
        groups[f"external torque of {name}"] = SignalGroup("Nm", (name,), (f"tau_ext.{name}",))
    for sensor in robot.sensor_names:
        _add_wrench(groups, f"{sensor}: wrench on all outboard", f"{sensor}.ext", signals)
    return groups


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


def window_around(replay: Replay, time: float, length: float | None) -> tuple[float, float]:
    """The piece of time that is shown: `length` [s] around `time`, or all for None."""
    whole = replay.end - replay.start
    if length is None or length >= whole:
        return replay.start, max(replay.end, replay.start + 1e-3)
    begin = min(max(time - LEFT_OF_NOW * length, replay.start), replay.end - length)
    return begin, begin + length


def with_now(times: Array, values: list[Array], now: float) -> tuple[Array, ...]:
    """Data of a plot: times, values, and an upright line at `now` over their range."""
    finite = np.concatenate([v[np.isfinite(v)] for v in values] or [[]])
    low, high = (min(finite.min(), 0.0), max(finite.max(), 0.0)) if len(finite) else (0.0, 0.0)
    room = 0.05 * ((high - low) or 1.0)
    at = int(np.searchsorted(times, now))
    x = np.insert(times, at, [now, now])
    ys = [np.insert(v, at, [np.nan, np.nan]) for v in values]
    line = np.full(len(x), np.nan)
    line[at : at + 2] = low - room, high + room
    return (x, *ys, line)


class SignalPlot:
    """One plot on the page.

    Args:
        gui: of the page.
        replay: that is shown.
        origin: from where times count on the page [s].
    """

    HEIGHT = 190

    def __init__(self, gui: viser.GuiApi, replay: Replay, origin: float) -> None:
        self._gui, self._replay, self._origin = gui, replay, origin
        self._handle: viser.GuiUplotHandle | None = None
        self._group: SignalGroup | None = None
        self._shown: tuple = ()

    def update(self, group: SignalGroup, now: float, length: float | None, order: float) -> None:
        """Shows a group of signals around a time.

        Args:
            group: what is shown.
            now: the time [s] that is marked.
            length: of the time shown [s]; None: all.
            order: place on the page.
        """
        begin, end = window_around(self._replay, now, length)
        if (group, begin, end, now) == self._shown:
            return
        self._shown = (group, begin, end, now)
        step = (end - begin) / PIECES
        begin = np.floor(begin / step) * step  # pieces that stand still while the window moves
        end = begin + step * (PIECES + 1)
        found = [self._replay.curve(c, begin, end, PIECES + 1) for c in group.columns]
        values = [values for _, values in found]
        data = with_now(found[0][0] - self._origin, values, now - self._origin)
        if self._handle is None or group is not self._group:
            self._make(group, data, order)
        else:
            self._handle.data = data

    def _make(self, group: SignalGroup, data: tuple[Array, ...], order: float) -> None:
        if self._handle is not None:
            self._handle.remove()
        self._group = group
        series: list[viser.uplot.Series] = [viser.uplot.Series(label="s")]
        for i, name in enumerate(group.names):
            colour = COLOURS[i % len(COLOURS)]
            series.append(viser.uplot.Series(label=name, stroke=colour, width=1.5))
        series.append(viser.uplot.Series(label="now", stroke=NOW, width=1.5))
        self._handle = self._gui.add_uplot(
            data,
            tuple(series),
            scales={"x": viser.uplot.Scale(time=False)},
            axes=(viser.uplot.Axis(), viser.uplot.Axis(label=group.unit, labelSize=18, size=52)),
            height=self.HEIGHT,
            order=order,
        )
