# SPDX-License-Identifier: Apache-2.0
"""Where a segment is touched, and how sure that is."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from touchline.classifier.classifier import Classifier
from touchline.detector.detector import Detection
from touchline.detector.residual_noise import native_noise
from touchline.detector.thresholds import Thresholds
from touchline.localizer.answer import ENDED, NUMBER, Answer, Names, event_answer
from touchline.localizer.region import Region
from touchline.localizer.skin import Skin
from touchline.native import core
from touchline.observer.observer import Estimate, Observer
from touchline.result.event import EventAnswer

Array = NDArray[np.float64]

RULES = ("likelihood", "paper")
FRICTION = 0.8  # coefficient of the friction cone: skin and rubber
TORQUE_ERROR = 0.02  # a joint's torque sensor is no better, and a touch is no point
MODEL_ERROR = 0.02  # masses and inertias of a good model from CAD are no better


class Localizer:
    """One estimator for every layout of sensors (see the native `localizer.hpp`).

    Candidates are all entries of the line of force action into all links of the segment, the
    surface nearest to it where it misses, and sampled points where joint torques alone leave no
    line. Each is weighed by its posterior, given the segment's wrench, the joint rows and the
    covariance of all of them.

    Args:
        observer: whose estimates are to be localized; gives the robot and the bandwidths.
        thresholds: of the detector, if its offsets are to be taken out (see `locate`).
        period: time between samples [s]: the noise figures are per sample.
        rule: "likelihood", or "paper": the first entry along the line, on no matter which link.
        friction: coefficient of the friction cone.
        wrench_error: of the gains of six-axis sensors and of the model, as a part of the load.
        torque_error: the same of joint torques; what noise figures do not cover.
        skin: the robot's surfaces, if already at hand.

    Raises:
        ValueError: for an unknown rule.
    """

    def __init__(
        self,
        observer: Observer,
        thresholds: Thresholds | None = None,
        period: float = 1e-3,
        rule: str = "likelihood",
        friction: float = FRICTION,
        wrench_error: float = 0.0,
        torque_error: float = TORQUE_ERROR,
        skin: Skin | None = None,
    ) -> None:
        if rule not in RULES:
            raise ValueError(f"rule is '{rule}', allowed: {', '.join(RULES)}")
        self.observer, self.robot = observer, observer.robot
        self.skin = skin or Skin(self.robot)
        self._names = Names(self.skin.patches, {body.node: body.name for body in self.robot.bodies})
        graspable = self.robot.description.graspable
        settings = core.LocalizerSettings()
        settings.friction = friction
        settings.first_entry = rule == "paper"
        rows = thresholds.rows if thresholds else ()
        self.core = core.Localizer(
            observer.kernel,
            [core.DetectionRow(**vars(row)) for row in rows],
            native_noise(self.robot, period, wrench_error, torque_error),
            [
                core.LinkSurface(patch.node, patch.mesh, patch.link in graspable)
                for patch in self.skin.patches
            ],
            settings,
        )

    def locate(
        self,
        segment: str,
        q: ArrayLike,
        estimate: Estimate,
        detection: Detection | None = None,
        qd: ArrayLike | None = None,
    ) -> Answer:
        """The contact on a segment at one instant.

        Args:
            segment: name of the segment.
            q: joint positions (n,) [rad or m].
            estimate: of one sample.
            detection: of that sample, if the detector's offsets are to be taken out; needs the
                thresholds of that detector.
            qd: joint velocities (n,) [rad/s or m/s].
        """
        row = self.core.locate(
            self.robot.segment_names.index(segment),
            estimate.rows,
            None if detection is None else detection.normalized,
            np.ascontiguousarray(q, float),
            None if qd is None else np.ascontiguousarray(qd, float),
            None if detection is None else detection.drift,
            None if detection is None else detection.quiet,
        )
        return self.answer(row[0])

    def follow(
        self,
        classifier: Classifier,
        time: Array,
        q: Array,
        qd: Array,
        estimate: Estimate,
        detection: Detection,
    ) -> tuple[Array, Array]:
        """Takes N samples, and the classifier with it: who is touched where, and how.

        Returns:
            (M, w): a row for each sample and contact on a touched segment, with the columns of
            `touchline.localizer.answer`. And (E, v): sample, segment, number of the contact, then a
            native event, for `event_answer`, of each event that ended.
        """
        return self.core.follow(
            classifier.core,
            np.ascontiguousarray(time, float),
            estimate.rows,
            detection.normalized,
            detection.drift,
            detection.levels,
            detection.quiet,
            np.ascontiguousarray(q, float),
            np.ascontiguousarray(qd, float),
        )

    def follow_sample(
        self,
        classifier: Classifier,
        time: float,
        q: Array,
        qd: Array,
        estimate: Estimate,
        detection: Detection,
    ) -> tuple[Array, Array]:
        """Takes one sample, as `follow` takes N."""
        return self.core.follow_sample(
            classifier.core,
            time,
            estimate.rows,
            detection.normalized,
            detection.drift,
            detection.levels,
            detection.quiet,
            q,
            qd,
        )

    def region(self) -> Region:
        """The posterior over links and surfaces of the only contact of the last sample.

        Of the last call of `locate`, or of the last sample of `Pipeline.update` or `run` in which
        something touched. Takes milliseconds: worked out when asked for.

        Raises:
            ValueError: there are several contacts, or none whose place follows from that sample
                alone; a `Contact` has `candidates` and `covariance` in any case.
        """
        cells = self.core.region()
        return Region(
            tuple(patch.link for patch in self.skin.patches),
            cells[:, 0].astype(int),
            cells[:, 1:4],
            cells[:, 4],
            np.exp(cells[:, 5]),
        )

    def open_events(self) -> dict[int, EventAnswer]:
        """The events that last, by the number of the contact."""
        return {int(row[NUMBER]): self.event_answer(row[ENDED:]) for row in self.core.events()}

    def event_answer(self, row: Array) -> EventAnswer:
        """Names the numbers of a native event."""
        return event_answer(row, self._names, self.robot)

    def wrench_covariance(
        self,
        segment: str,
        q: ArrayLike,
        estimate: Estimate,
        detection: Detection | None = None,
    ) -> Array:
        """Covariance (6, 6) of a segment's filtered wrench, world axes, about the world origin.

        It follows from the noise figures of the description: readings through the filter, and
        velocities through the momentum (theory: sqrt(K dt / 2) and K M sigma_qd). To that comes
        what the model's errors have added since the baseline, by the `drift` of a detection.
        """
        index = self.robot.segment_names.index(segment)
        q = np.ascontiguousarray(q, float)
        drift = None if detection is None else detection.drift
        return self.core.wrench_covariance(q, estimate.rows, index, drift)

    def answer(self, row: Array) -> Answer:
        """Names the numbers of a native answer."""
        return Answer(row, self._names)
