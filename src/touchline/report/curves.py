# SPDX-License-Identifier: Apache-2.0
"""What the report plots: which curves, in which panels, gathered while a recording streams by."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchline.detector.detector import Detection
from touchline.observer.observer import Estimate
from touchline.pipeline.pipeline import Pipeline
from touchline.report.traces import Traces

Array = NDArray[np.float64]

POINTS = 240_000  # pieces of time times curves: bounds the report's size, 5.3 bytes each
MOST_BUCKETS = 1 << 14


@dataclass(frozen=True)
class Curve:
    """One curve of a panel: its name, and the column of the traces that holds it."""

    name: str
    column: int


@dataclass(frozen=True)
class Panel:
    """One plot.

    Attributes:
        kind: "joint", "segment" or "test".
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

    def __init__(self, pipeline: Pipeline, period: float) -> None:
        self._robot = pipeline.robot
        self._rows = pipeline.thresholds.rows
        self._joint_rows = {row.joint: i for i, row in enumerate(self._rows) if row.joint >= 0}
        self._segments = [i for i, s in enumerate(self._robot.segment_names) if s != "root"]
        self._columns = 0
        self.panels = [*self._joint_panels(), *self._segment_panels(), *self._test_panels()]
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
                panels.append(Panel("joint", joint.name, "Nm", None, self._take("external torque")))
                continue
            row = self._rows[self._joint_rows[j]]
            torque, own, baseline = self._take("external torque", "from its own segment", "")
            segment = self._robot.segment_names[row.segment]
            curves = (torque, own) if len(self._robot.segment_names) > 1 else (torque,)
            panel = Panel("joint", joint.name, "Nm", segment, curves, baseline.column, row.contact)
            panels.append(panel)
        return panels

    def _segment_panels(self) -> list[Panel]:
        panels = []
        for g in self._segments:
            name = self._robot.segment_names[g]
            force, moment = self._take("fx", "fy", "fz"), self._take("mx", "my", "mz")
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

    def event_panels(self, segment: str) -> list[Panel]:
        """What is plotted around an event on a segment: its wrench, its test, all joint torques."""
        own = [p for p in self.panels if p.kind != "joint" and p.segment == segment]
        joints = [p for p in self.panels if p.kind == "joint"]
        curves = tuple(Curve(p.title, p.curves[0].column) for p in joints)
        return [*own, Panel("joint", "external joint torques", "Nm", None, curves)]

    def values(self, estimate: Estimate, detection: Detection) -> Array:
        """All columns (N, c) of N samples."""
        parts = [*self._joint_values(estimate, detection)]
        parts += [estimate.segment_wrench[:, g] for g in self._segments]
        return np.hstack([*parts, *self._test_values(detection)])

    def _joint_values(self, estimate: Estimate, detection: Detection) -> list[Array]:
        values = []
        for j in range(len(self._robot.joint_names)):
            columns = [estimate.tau_ext[:, j]]
            if j in self._joint_rows:
                i = self._joint_rows[j]
                own, test = estimate.segment_torque[:, j], detection.normalized[:, i]
                settled = np.where(estimate.joint_settled[:, j], own, np.nan)
                columns += [own, settled - test * self._rows[i].contact]
            values.append(np.column_stack(columns))
        return values

    def _test_values(self, detection: Detection) -> list[Array]:
        values = []
        for g in range(len(self._robot.segment_names)):
            own = [i for i, row in enumerate(self._rows) if row.segment == g]
            tests = np.abs(detection.normalized[:, own])
            values.append(tests.max(axis=1, initial=0.0)[:, None])
        return values
