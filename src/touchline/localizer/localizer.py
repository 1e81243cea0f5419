# SPDX-License-Identifier: Apache-2.0
"""Where a segment is touched, and how sure that is."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array
from touchline.detector.detector import Detection
from touchline.detector.residual_noise import native_noise
from touchline.detector.thresholds import Thresholds
from touchline.localizer.region import Region
from touchline.localizer.skin import Skin
from touchline.model.description import PushDescription
from touchline.model.robot import Robot
from touchline.native import core
from touchline.observer.observer import Estimate, Observer
from touchline.result.contact import Contact
from touchline.result.native import Names

RULES = ("likelihood", "paper")
TORQUE_ERROR = 0.02  # a joint's torque sensor is no better, and a touch is no point
# Data sheets of six-axis sensors state about as much. Motion without a touch does not show it.
WRENCH_ERROR = 0.01
MODEL_ERROR = 0.02  # masses and inertias of a good model from CAD are no better


def require_rule(rule: str) -> None:
    """Raises ValueError for a rule that there is not."""
    if rule not in RULES:
        raise ValueError(f"rule is '{rule}', allowed: {', '.join(RULES)}")


def localizer_settings(rule: str, pushes: PushDescription) -> core.LocalizerSettings:
    """In the words of the native core.

    Raises:
        ValueError: for an unknown rule.
    """
    require_rule(rule)
    settings = core.LocalizerSettings()
    settings.friction, settings.finger = pushes.friction, pushes.reach
    settings.first_entry = rule == "paper"
    return settings


def expected_pushes(robot: Robot, friction: float | None = None) -> PushDescription:
    """The pushes that a robot expects, of another coefficient of friction if one is given."""
    pushes = robot.description.pushes
    return pushes if friction is None else replace(pushes, friction=friction)


def native_surfaces(robot: Robot, skin: Skin) -> list[core.LinkSurface]:
    """The surfaces of all links in the words of the native core."""
    description = robot.description
    touchable = description.pushes.links or [patch.link for patch in skin.patches]
    return [
        core.LinkSurface(p.node, p.mesh, p.link in description.graspable, p.link in touchable)
        for p in skin.patches
    ]


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
        friction: coefficient of the friction cone; default: the description's.
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
        friction: float | None = None,
        wrench_error: float = 0.0,
        torque_error: float = TORQUE_ERROR,
        skin: Skin | None = None,
    ) -> None:
        self.observer, self.robot = observer, observer.robot
        settings = localizer_settings(rule, expected_pushes(self.robot, friction))
        self.skin = skin or Skin(self.robot)
        self.skin.check_robot(self.robot)
        self._names = Names.of(
            self.robot.segment_names,
            self.robot.joint_names,
            [patch.link for patch in self.skin.patches],
            [patch.body for patch in self.skin.patches],
        )
        rows = thresholds.rows if thresholds else ()
        self.core = core.Localizer(
            observer.kernel,
            [core.DetectionRow(**vars(row)) for row in rows],
            native_noise(self.robot, period, wrench_error, torque_error),
            native_surfaces(self.robot, self.skin),
            settings,
        )

    def locate(
        self,
        segment: str,
        q: ArrayLike,
        estimate: Estimate,
        detection: Detection | None = None,
        qd: ArrayLike | None = None,
    ) -> Contact:
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
        return Contact.of(row, self._names)

    def region(self) -> Region:
        """The posterior over links and surfaces of the contact of the last `locate`.

        Takes milliseconds: worked out when asked for.

        Raises:
            ValueError: nothing was located.
        """
        return Region.of(self.skin, self.core.region())

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
