# SPDX-License-Identifier: Apache-2.0
"""What the report plots: which curves, in which panels, gathered while a recording streams by."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array
from touchline.detector.detector import Detection
from touchline.errors import InputError
from touchline.observer.observer import Estimate
from touchline.observer.samples import Samples
from touchline.pipeline.pipeline import Pipeline
from touchline.report.beside import Beside
from touchline.report.traces import Traces

LOGGED = (("positions", "rad"), ("velocities", "rad/s"), ("torques", "in logged units"))
ABSURD = 1e6  # rad, rad/s, N, Nm: no reading, as in the core
POINTS = 240_000  # pieces of time times curves: bounds the report's size, 5.3 bytes each
MOST_BUCKETS = 1 << 14
AXES = ("fx", "fy", "fz", "mx", "my", "mz")


@dataclass(frozen=True)
class Curve:
    """One curve of a panel.

    Attributes:
        name: in the key.
        column: of the traces that hold it.
        result: column of `estimates.parquet` that holds it, where there is one.
        beside: whether it is of other results.
    """

    name: str
    column: int
    result: str | None = None
    beside: bool = False


@dataclass(frozen=True)
class Panel:
    """One plot.

    Attributes:
        kind: "joint", "segment", "test", or "signal" for what was logged.
        title: of the plot.
        unit: of its curves.
        segment: whose events are shaded, None for all.
        curves: what is drawn.
        band: the column of the baseline, around which thresholds lie.
        limit: the contact threshold, on either side of the baseline.
    """

    kind: str
    title: str
    unit: str
    segment: str | None
    curves: tuple[Curve, ...]
    band: int | None = None
    limit: float | None = None


class Curves:
    """Panels and their traces for one analysis."""

    def __init__(self, pipeline: Pipeline, period: float, beside: Beside | None = None) -> None:
        self._robot = pipeline.robot
        self._rows = pipeline.thresholds.rows
        self._joint_rows = {row.joint: i for i, row in enumerate(self._rows) if row.joint >= 0}
        self._segments = [i for i, s in enumerate(self._robot.segment_names) if s != "root"]
        self._columns = 0
        self.panels = [*self._joint_panels(), *self._segment_panels(), *self._test_panels()]
        self.panels += self._signal_panels()
        self.beside = beside
        self._compared = [] if beside is None else self._compare(beside)
        buckets = 2 ** int(np.log2(POINTS / max(self._columns, 1)))
        self.traces = Traces(self._columns, min(buckets, MOST_BUCKETS), period)

    def _take(self, *names: str) -> tuple[Curve, ...]:
        start = self._columns
        self._columns += len(names)
        return tuple(Curve(name, start + i) for i, name in enumerate(names))

    def _joint_panels(self) -> list[Panel]:
        """The order of the columns is that of `_joint_values`."""
        panels = []
        for j, joint in enumerate(self._robot.description.joints):
            if j not in self._joint_rows:
                (torque,) = self._take("external torque")
                torque = replace(torque, result=f"tau_ext.{joint.name}")
                panels.append(Panel("joint", joint.name, "Nm", None, (torque,)))
                continue
            row = self._rows[self._joint_rows[j]]
            torque, own, baseline = self._take("external torque", "from its own segment", "")
            torque = replace(torque, result=f"tau_ext.{joint.name}")
            segment = self._robot.segment_names[row.segment]
            curves = (torque, own) if len(self._robot.segment_names) > 1 else (torque,)
            panel = Panel("joint", joint.name, "Nm", segment, curves, baseline.column, row.contact)
            panels.append(panel)
        return panels

    def _segment_panels(self) -> list[Panel]:
        panels = []
        for g in self._segments:
            name = self._robot.segment_names[g]
            axes = [replace(c, result=f"{name}.seg.{c.name}") for c in self._take(*AXES)]
            force, moment = tuple(axes[:3]), tuple(axes[3:])
            panels.append(Panel("segment", f"{name}: force", "N", name, force))
            panels.append(Panel("segment", f"{name}: moment", "Nm", name, moment))
        return panels

    def _test_panels(self) -> list[Panel]:
        unit = "of the contact threshold"
        return [
            Panel(
                "test", f"{name}: largest test", unit, name, self._take("largest test"), None, 1.0
            )
            for name in self._robot.segment_names
        ]

    def _signal_panels(self) -> list[Panel]:
        """The order of the columns is that of `_signals`."""
        joints = self._robot.joint_names
        panels = [
            Panel("signal", f"{title}, as logged", unit, None, self._take(*joints))
            for title, unit in LOGGED
        ]
        for name in self._robot.sensor_names:
            force, moment = self._take(*AXES[:3]), self._take(*AXES[3:])
            panels.append(Panel("signal", f"{name}: force, as logged", "N", None, force))
            panels.append(Panel("signal", f"{name}: moment, as logged", "Nm", None, moment))
        return panels

    def _compare(self, beside: Beside) -> list[Curve]:
        """Curves for the columns that the other results have too."""
        same = [c for p in self.panels for c in p.curves if c.result in beside.columns]
        if not same:
            raise InputError(f"--beside {beside.folder}: no joint or segment of this robot in it")
        columns = self._take(*(f"{c.name}, {beside.name}" for c in same))
        return [
            replace(c, result=old.result, beside=True) for c, old in zip(columns, same, strict=True)
        ]

    def add_beside(self, last: float) -> None:
        """Take the other results, once all samples of this recording are in; it ends at `last`."""
        if self.beside is None:
            return
        names = [str(curve.result) for curve in self._compared]
        columns = [curve.column for curve in self._compared]
        self.beside.place(self.traces.start, last)
        for time, values in self.beside.read(names):
            padded = np.full((len(time), self._columns), np.nan)
            padded[:, columns] = values
            self.traces.add(time, padded)

    def on_page(self) -> list[Panel]:
        """The panels with the curves of other results; signals that were not logged are left out.

        Those of other results come last in their panel.
        """
        low = self.traces.low
        others = {curve.result: curve for curve in self._compared}
        panels = []
        for panel in self.panels:
            curves = panel.curves
            if panel.kind == "signal":
                curves = tuple(c for c in curves if np.isfinite(low[:, c.column]).any())
            extra = tuple(others[c.result] for c in curves if c.result in others)
            if curves:
                panels.append(replace(panel, curves=curves + extra))
        return panels

    def event_panels(self, segment: str) -> list[Panel]:
        """What is plotted around an event on a segment: its wrench, its test, all joint torques."""
        own = [p for p in self.panels if p.kind != "joint" and p.segment == segment]
        joints = [p for p in self.panels if p.kind == "joint"]
        curves = tuple(Curve(p.title, p.curves[0].column) for p in joints)
        return [*own, Panel("joint", "external joint torques", "Nm", None, curves)]

    def values(self, samples: Samples, estimate: Estimate, detection: Detection) -> Array:
        """All columns (N, c) of N samples, one after another in memory.

        Those of other results are unknown.
        """
        values = np.empty((self._columns, len(samples)))
        parts = (*self._joint_values(estimate, detection), *self._of_segments(estimate, detection))
        end = 0
        for part in (*parts, *_signals(samples)):
            begin, end = end, end + part.shape[-1]
            values[begin:end] = part.T
        values[end:] = np.nan
        return values.T

    def _joint_values(self, estimate: Estimate, detection: Detection) -> Iterator[Array]:
        torques, own_torques = estimate.tau_ext, estimate.segment_torque
        settled = estimate.joint_settled
        for j in range(len(self._robot.joint_names)):
            yield torques[:, j, None]
            if j in self._joint_rows:
                i = self._joint_rows[j]
                own, test = own_torques[:, j], detection.normalized[:, i]
                known = np.where(settled[:, j], own, np.nan)
                yield own[:, None]
                yield (known - test * self._rows[i].contact)[:, None]

    def _of_segments(self, estimate: Estimate, detection: Detection) -> Iterator[Array]:
        for g in self._segments:
            yield estimate.segment_wrench[:, g]
        for g in range(len(self._robot.segment_names)):
            own = [i for i, row in enumerate(self._rows) if row.segment == g]
            tests = np.abs(detection.normalized[:, own])
            yield tests.max(axis=1, initial=0.0)[:, None]


def _signals(samples: Samples) -> Iterator[Array]:
    """As logged; what the core takes for infinite is left out."""
    sensors = [samples.wrench[:, k] for k in range(samples.wrench.shape[1])]
    for values in (samples.q, samples.qd, samples.tau, *sensors):
        usual = np.abs(values) < ABSURD
        yield values if usual.all() else np.where(usual, values, np.nan)
