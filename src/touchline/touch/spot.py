# SPDX-License-Identifier: Apache-2.0
"""Spots that joint torques alone tell: by the direction of the torque step that a touch brings.

In one posture a push at one place in one direction always brings torques in the same proportion,
whatever its force. So a spot is taught by touching it, and told from others and from touches
elsewhere ("none of them") by its direction in the space of joint torques. What touches elsewhere
can bring, and how a hand's wavering shows, follow from the robot's surface (`pushes.py`); how much
this hand wavers on this spot, from the touches that taught it.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from touchline.arrays import Array
from touchline.localizer.skin import Skin
from touchline.model.description import TaughtTouch
from touchline.touch.pushes import Directions, Mask, Pushes, log_sum

WAVER_FORCE = np.geomspace(0.02, 0.4, 7)  # rad: a hand's direction wavers by one of these (1-23°)
WAVER_PLACE = np.geomspace(0.001, 0.02, 7)  # m: its place by one of these, all equally likely
POSTURE = 0.1  # rad (rms over the joints): farther from where it was taught a spot is not told
STEP_NOISE = 0.05  # Nm: what noise and stiction leave in a step of one joint
BEFORE = 0.3, 0.03  # s: from when to when before a touch its torques are taken as those at rest
AVERAGE = 0.1  # s, over which the direction of a torque step is averaged
LEAST_STEP = 0.3  # Nm; smaller steps have no direction worth the name
LIKELIER = 0.5  # probability from which a spot counts: it is likelier than all else together


class _Spot:
    """One spot in one posture.

    Args:
        name: of its widget.
        q: (n,) the posture.
        steps: (K, n) that taught it [Nm].
        known: (n,) bool, the joints that count.
        pushes: in this posture.
    """

    def __init__(self, name: str, q: Array, steps: Array, known: Mask, pushes: Pushes) -> None:
        self.name, self.q, self.pushes = name, q, pushes
        sizes = np.linalg.norm(steps[:, known], axis=1)
        self.least = float(sizes.min())
        units = steps[:, known] / sizes[:, None]
        middle = units.mean(axis=0)
        middle /= np.linalg.norm(middle)
        noise = STEP_NOISE / sizes
        self.doubt = float(noise.mean()) / np.sqrt(len(units))  # that noise leaves in the middle
        by_force, by_place = pushes.wavering(middle, self.doubt)
        spreads = np.array(
            [f**2 * by_force + p**2 * by_place for f in WAVER_FORCE for p in WAVER_PLACE]
        )
        weights = _evidence(units, middle, spreads, noise)
        many = np.tile(middle, (len(spreads), 1))
        self.directions = Directions.of(many, (1.0 + 1.0 / len(units)) * spreads, weights)

    def evidence(self, unit: Array, noise: float) -> float:
        """How much likelier a direction (n,) is on this spot than elsewhere; a logarithm.

        Both are looked at as sharply as the lessons and the noise of one sigma `noise` allow.
        """
        sharp = float(np.hypot(noise, self.doubt))
        here = self.directions.log_density(unit, sharp)
        return here - self.pushes.log_density(unit, sharp)


def _evidence(units: Array, middle: Array, spreads: Array, noise: Array) -> Array:
    """How likely each spread (M, n, n) is, of taught directions (K, n) about their mean; sum 1."""
    if len(units) == 1:
        return np.full(len(spreads), 1.0 / len(spreads))
    logs = np.zeros(len(spreads))
    for unit, sigma in zip(units, noise, strict=True):
        total = spreads + sigma**2 * np.eye(len(middle))
        off = unit / (unit @ middle) - middle
        far = np.einsum("j,ijk,k->i", off, np.linalg.inv(total), off)
        # The mean was taken from them: one of K directions is used up.
        logs -= 0.5 * (far + (1.0 - 1.0 / len(units)) * np.linalg.slogdet(total)[1])
    shares = np.exp(logs - logs.max())
    return shares / shares.sum()


class TorqueSpots:
    """Tells taught spots by torque steps.

    Args:
        taught: the touches that taught each spot.
        skin: of the robot.
    """

    def __init__(self, taught: Mapping[str, Sequence[TaughtTouch]], skin: Skin) -> None:
        self._skin = skin
        self._taught = [
            (name, q, steps)
            for name, touches in taught.items()
            for q, steps in _by_posture(touches)
        ]
        self._spots: dict[bytes, list[_Spot]] = {}
        self._of(np.array([joint.torque != "none" for joint in skin.robot.description.joints]))

    @property
    def names(self) -> tuple[str, ...]:
        """Of all spots."""
        return tuple(dict.fromkeys(name for name, _, _ in self._taught))

    def least(self, q: Array) -> float:
        """The softest touch that taught a spot in this posture (n,) [Nm]; infinite without one."""
        sizes = [
            np.linalg.norm(steps, axis=1).min()
            for _, posture, steps in self._taught
            if _apart(posture, q) < POSTURE
        ]
        return float(min(sizes, default=np.inf))

    def read(self, q: Array, step: Array) -> list[tuple[str | None, float]]:
        """Which spot a touch is on: (name, probability), best first; None: none of them.

        Args:
            q: joint positions (n,) [rad or m].
            step: (n,) change of the external torque by the touch [Nm]; NaN where not measured.
        """
        known = np.isfinite(step)
        size = float(np.linalg.norm(step[known]))
        if size < LEAST_STEP or not any(_apart(at, q) < POSTURE for _, at, _ in self._taught):
            return [(None, 1.0)]
        near = [spot for spot in self._of(known) if _apart(spot.q, q) < POSTURE]
        unit, noise = step[known] / size, STEP_NOISE / size
        scores: list[tuple[str | None, float]] = [
            (spot.name, spot.evidence(unit, noise) - np.log(len(near))) for spot in near
        ]
        scores.append((None, 0.0))
        return _shares(scores)

    def read_event(
        self, time: Array, q: Array, torque: Array, begin: float, end: float
    ) -> list[tuple[str | None, float]]:
        """Which spot a touch between two instants [s] was on, as `read`.

        Args:
            time: (N,) [s], from before the touch to its end or later.
            q: joint positions (N, n) [rad or m].
            torque: (N, n) external torques [Nm].
            begin: when it was detected.
            end: when it was cleared, or the last instant.
        """
        before = (time >= begin - BEFORE[0]) & (time <= begin - BEFORE[1])
        during = np.flatnonzero((time >= begin) & (time <= end))
        if not before.any() or not len(during):
            return [(None, 1.0)]
        steps = torque[during] - torque[before].mean(axis=0)
        mean = np.array(
            [steps[np.abs(time[during] - time[row]) <= AVERAGE / 2].mean(axis=0) for row in during]
        )
        largest = int(np.argmax(np.linalg.norm(np.nan_to_num(mean), axis=1)))
        return self.read(q[during[largest]], mean[largest])

    def _of(self, known: Mask) -> list[_Spot]:
        """The spots as the joints `known` (n,) show them."""
        key = known.tobytes()
        if key not in self._spots:
            spots: list[_Spot] = []
            for name, q, steps in self._taught:
                same = (spot.pushes for spot in spots if _apart(spot.q, q) < POSTURE / 10)
                pushes = next(same, None) or Pushes(self._skin, q, known)
                spots.append(_Spot(name, q, steps, known, pushes))
            self._spots[key] = spots
        return self._spots[key]


def _apart(one: Array, other: Array) -> float:
    """How far two postures (n,) are apart [rad], rms over the joints."""
    return float(np.sqrt(np.mean((one - other) ** 2)))


def _by_posture(touches: Sequence[TaughtTouch]) -> list[tuple[Array, Array]]:
    """Joint positions (n,) of each posture, and the steps (K, n) taught there."""
    postures: list[tuple[Array, list[Array]]] = []
    for touch in touches:
        q, step = np.array(touch.q), np.array(touch.step)
        for known, steps in postures:
            if _apart(known, q) < POSTURE:
                steps.append(step)
                break
        else:
            postures.append((q, [step]))
    return [(q, np.array(steps)) for q, steps in postures]


def _shares(scores: list[tuple[str | None, float]]) -> list[tuple[str | None, float]]:
    names = dict.fromkeys(name for name, _ in scores)
    logs = {n: log_sum(np.array([score for name, score in scores if name == n])) for n in names}
    total = log_sum(np.array(list(logs.values())))
    shares = [(name, float(np.exp(score - total))) for name, score in logs.items()]
    return sorted(shares, key=lambda pair: -pair[1])
