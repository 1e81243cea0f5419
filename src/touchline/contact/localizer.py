# SPDX-License-Identifier: Apache-2.0
"""Where a segment is touched, and how sure that is."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from touchline.contact.contact import Candidate
from touchline.contact.detector import Detection, native_noise
from touchline.contact.region import Region
from touchline.contact.skin import Skin
from touchline.contact.thresholds import Thresholds
from touchline.estimation.observer import Estimate, Observer
from touchline.native import core

Array = NDArray[np.float64]

RULES = ("likelihood", "paper")
STATUS = (None, "located", "ambiguous", "not_separable", "wrench_only")
FRICTION = 0.8  # coefficient of the friction cone: skin and rubber
TORQUE_ERROR = 0.02  # a joint's torque sensor is no better, and a touch is no point
CONTACT = 3  # numbers before an answer or an event: sample, segment, number of the contact
FORCE, UNKNOWNS = slice(7, 10), 23  # in an answer
HEAD, OF_CANDIDATE, PER_CANDIDATE = (
    25,
    7,
    6,
)  # numbers of a native answer (see core/contact_bindings.hpp)


@dataclass(frozen=True)
class Answer:
    """Where a segment is touched at one instant; what is not known is None.

    Attributes:
        status: "located", "ambiguous", "not_separable" or "wrench_only"; None without a
            measurement.
        link: the link that carries the point, of the rigid `body`.
        body_probability: of that body, 0 to 1.
        position: (3,) [m] in world; None where no point is an honest answer.
        force: (3,) [N] on the robot, in world.
        covariance: (3, 3) [m2] of the position, along the surface.
        pitch: how far the wrench is from that of one pure force [standard deviations].
        chi2: misfit of the best explanation, with `degrees` of freedom.
        rank: independent equations for contacts that cannot be told apart, of the `unknowns`.
        candidates: all explanations, best first.
    """

    status: str | None
    link: str | None = None
    body: str | None = None
    body_probability: float | None = None
    position: Array | None = None
    force: Array | None = None
    covariance: Array | None = None
    pitch: float | None = None
    chi2: float | None = None
    degrees: int = 0
    rank: int | None = None
    unknowns: int | None = None
    candidates: tuple[Candidate, ...] = ()


@dataclass(frozen=True)
class EventAnswer:
    """Where an event is, from all its strong samples; see `touchline.Event`."""

    status: str
    link: str | None = None
    body: str | None = None
    body_probability: float | None = None
    position: Array | None = None
    position_link: Array | None = None
    time_of_position: float | None = None
    position_std: float | None = None
    candidates: tuple[Candidate, ...] = ()


class Localizer:
    """One estimator for every layout of sensors (see `core/include/touchline/localizer.hpp`).

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
        self._body_names = {body.node: body.name for body in self.robot.bodies}
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
            None if detection is None else detection.quiet,
        )
        return self.answer(row[0])

    def follow(
        self, time: Array, q: Array, qd: Array, estimate: Estimate, detection: Detection
    ) -> tuple[Array, Array]:
        """Takes N samples: answers where a segment is touched, and keeps track of the events.

        Returns:
            (M, 3 + w): sample, segment, number of the contact, then a native answer for `answer`;
            one row for each sample and contact on a touched segment. And (E, 3 + v): sample,
            segment, number of the contact, then a native event, for `event_answer`, of each event
            that ended.
        """
        return self.core.follow(
            np.ascontiguousarray(time, float),
            estimate.rows,
            detection.normalized,
            detection.levels,
            detection.quiet,
            np.ascontiguousarray(q, float),
            np.ascontiguousarray(qd, float),
        )

    def follow_sample(
        self, time: float, q: Array, qd: Array, estimate: Estimate, detection: Detection
    ) -> tuple[Array, Array]:
        """Takes one sample, as `follow` takes N."""
        return self.core.follow_sample(
            time,
            estimate.rows,
            detection.normalized,
            detection.levels,
            detection.quiet,
            q,
            qd,
        )

    def region(self) -> Region:
        """The posterior over links and surfaces of the contact that was located last.

        Of the last call of `locate`, or of the last sample of `Pipeline.update` or `run`. Takes
        milliseconds: worked out when asked for.
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
        return {int(row[2]): self.event_answer(row[CONTACT:]) for row in self.core.events()}

    def event_answer(self, row: Array) -> EventAnswer:
        """Names the numbers of a native event."""
        status = STATUS[int(row[0])] or "wrench_only"
        n = len(self.robot.joint_names)
        time, variance, q = float(row[1]), float(row[2]), row[4 : 4 + n]
        places = row[4 + n :].reshape(-1, PER_CANDIDATE)[: int(row[3])]
        poses = self.robot.poses(q) if len(places) else np.empty((0, 4, 4))
        candidates = tuple(self._candidate(place, poses) for place in places)
        if status not in ("located", "ambiguous"):
            return EventAnswer(status, candidates=candidates)
        best = candidates[0]
        T_node_link = self.skin.patches[int(places[0][0])].T_node_link
        return EventAnswer(
            status,
            best.link,
            best.body,
            sum(other.probability for other in candidates if other.body == best.body),
            best.position,
            T_node_link[:3, :3].T @ (places[0][3:] - T_node_link[:3, 3]),
            time,
            float(np.sqrt(variance)),
            candidates,
        )

    def _candidate(self, place: Array, poses: Array) -> Candidate:
        surface, node, share = place[:3]
        T = poses[int(node)]
        position = T[:3, :3] @ place[3:] + T[:3, 3]
        link = self.skin.patches[int(surface)].link
        return Candidate(link, self._body_names[int(node)], float(share), position)

    def wrench_covariance(self, segment: str, q: ArrayLike, estimate: Estimate) -> Array:
        """Covariance (6, 6) of a segment's filtered wrench, world axes, about the world origin.

        It follows from the noise figures of the description: readings through the filter, and
        velocities through the momentum (theory: sqrt(K dt / 2) and K M sigma_qd).
        """
        index = self.robot.segment_names.index(segment)
        return self.core.wrench_covariance(np.ascontiguousarray(q, float), estimate.rows, index)

    def answer(self, row: Array) -> Answer:
        """Names the numbers of a native answer."""
        status = STATUS[int(row[0])]
        numbers: dict[str, Any] = {"rank": int(row[22]) or None, "unknowns": int(row[23]) or None}
        if row[HEAD - 1] == 0:
            return Answer(status, force=_known(row[7:10]), **numbers)
        candidates = self.candidates(row)
        numbers |= {"pitch": float(row[19]), "chi2": float(row[20]), "degrees": int(row[21])}
        if status in ("not_separable", "wrench_only"):
            return Answer(status, force=_known(row[7:10]), candidates=candidates, **numbers)
        return Answer(
            status,
            self.skin.patches[int(row[1])].link,
            self._body_names[int(row[2])],
            float(row[3]),
            row[4:7],
            row[7:10],
            row[10:19].reshape(3, 3),
            candidates=candidates,
            **numbers,
        )

    def candidates(self, row: Array) -> tuple[Candidate, ...]:
        """The explanations in a native answer, best first."""
        parts = row[HEAD:].reshape(-1, OF_CANDIDATE)[: int(row[HEAD - 1])]
        return tuple(
            Candidate(
                self.skin.patches[int(surface)].link,
                self._body_names[int(node)],
                float(weight),
                part[3:6],
                float(part[6]),
            )
            for surface, node, weight, part in ((*part[:3], part) for part in parts)
        )


def _known(values: Array) -> Array | None:
    return values if np.isfinite(values).all() else None
