# SPDX-License-Identifier: Apache-2.0
"""What would explain that weights are off: a body too many or too few, or a base that is tilted."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.check.averages import averaged
from touchline.check.findings import Findings
from touchline.check.fit import unit_errors
from touchline.check.joints import GAIN_OFF, UNEVEN
from touchline.identify.evidence import (
    WIDTHS,
    Evidence,
    gather,
    held_weights,
    level_axes,
    turned,
)
from touchline.identify.fit import main_links
from touchline.identify.identification import MOST_TOUCHED, touched_instants
from touchline.identify.leaning import leaned
from touchline.identify.payload import payload_link
from touchline.identify.touches import usual_scatter
from touchline.model.corrections import with_offsets
from touchline.model.description import Load, RobotDescription
from touchline.model.mechanism import Inertia
from touchline.model.robot import Robot
from touchline.model.transforms import combine_inertias
from touchline.observer.samples import Samples

MOST = 400_000  # samples that are looked at
RATE = 100.0  # Hz; loads change slowly beside it, and quicker samples are averaged
INSTANTS = 500  # that are weighed, over the whole recording
OFFSET = 0.3  # Nm or N, 1 sigma: what offsets and friction leave in any row of a sound robot
OFFSET_SHARE = 0.01  # the same, as a part of the largest reading
CENTRE = 0.1  # m, 1 sigma of a payload's centre about a hand's breadth before the flange
EXPLAINED = 0.6  # of what is off; less is no explanation
WHOLE = 0.95  # explains it, offset or not: weights change with its tilt as far as it is small
LEAST_MASS, LEAST_TILT = 0.15, np.radians(1.5)  # kg, rad: smaller ones are not told
MOST_TILT = 0.7  # rad; how far a base may lean whose tilt follows from two angles alone
SIZE_OFF = 0.15  # relative, of the length of gravity that a turned base would need
LEAST_SCALE = 0.1  # of a link's inertia; models are that good at best
RARE = 2.0 * np.log(100.0)  # of the cost: of a hundred errors of weights one is a link's, at most
ALIKE = 3.0  # of the cost; explanations closer than that are both told
SURE = 4.0  # standard errors
POSSIBLE = 2.0  # standard errors that a load has which could be there instead of wrong gains
ONE_POSE = 0.1  # rad
MOST_FOUND = 3
COULOMB_WIDTH, MOVED = 0.02, 0.02  # rad/s
# What is known of a motor's torque: friction is `UNEVEN` with the sense and the load that it works
# against, gains differ by a tenth. Both err alike in all poses, so more poses tell no more.
GAIN = 0.1
LIGHT = 0.02  # of a body that is left, and no less, has a centre that can be told


@dataclass(frozen=True)
class Explanation:
    """What would make up for what is off.

    Attributes:
        words: of the finding.
        short: what else it could be, in a few words.
        share: of the squares that it explains.
        cost: of what it leaves, and of how much it may choose freely.
        mended: the robot with it.
        fix: key and value of `robot.yaml` that mend it; a list is added to what stands there.
    """

    words: str
    short: str
    share: float
    cost: float
    mended: Robot
    fix: dict[str, Any]


def explain_weights(robot: Robot, parts: Iterable[Samples], findings: Findings) -> Robot:
    """Finds missing or surplus bodies and a tilted base; returns the robot as it then would be."""
    evidence = _untouched(robot, parts)
    if evidence is None:
        return robot
    told = robot
    for _ in range(MOST_FOUND):
        found = [x for x in _explanations(evidence, robot) if x.share >= EXPLAINED]
        found.sort(key=lambda x: x.cost)
        if not found:
            break
        best = found[0]
        offset = min(_offsets(evidence, robot), key=lambda x: x.cost, default=None)
        better = offset is not None and offset.cost < best.cost - ALIKE
        if offset is not None and better and best.share < WHOLE:
            robot = offset.mended  # told of its joint or sensor; what else is off shows beside it
            continue
        gains = _gains(evidence, robot)
        if gains is not None and gains.cost < best.cost - ALIKE:
            break  # of currents: told joint by joint
        others = [x for x in (gains, offset) if x is not None and x.cost < best.cost + ALIKE]
        found[1:1] = others
        more = [x.short for x in found[1:] if x.cost < best.cost + ALIKE]
        findings.find(best.words + (f"; or as well: {more[0]}" if more else ""))
        for key, value in best.fix.items():
            before = findings.fixes.get(key, []) if key == "loads" else []
            findings.fixes[key] = [*before, *value]
        robot = best.mended
        told = Robot(told.description, robot.mechanism)
    return told


def possible_load(robot: Robot, parts: Iterable[Samples]) -> tuple[str, Robot] | None:
    """The load that explains most of what is off though it is not sure: in words, and the robot."""
    evidence = _untouched(robot, parts)
    if evidence is None:
        return None
    left, sigma = _off(evidence, robot)
    loads = [_payload(evidence, robot, left, sigma, node, POSSIBLE) for node in _ends(robot)]
    told = [x for x in loads if x is not None and x.share >= EXPLAINED and x.fix]
    best = min(told, key=lambda x: x.cost, default=None)
    return None if best is None else (best.short, best.mended)


def _untouched(robot: Robot, parts: Iterable[Samples]) -> Evidence | None:
    """Some instants at which nothing seems to touch the robot; None where there are none."""
    try:
        evidence = gather(robot, [averaged(_first(parts), RATE)])
    except ValueError:
        return None
    evidence = evidence.part(np.arange(0, len(evidence), -(-len(evidence) // INSTANTS)))
    touched = touched_instants(evidence)
    if touched.mean() > MOST_TOUCHED or not evidence.used.any():
        return None
    return evidence.part(~touched)


def _first(parts: Iterable[Samples]) -> Iterable[Samples]:
    count = 0
    for part in parts:
        yield part
        count += len(part)
        if count > MOST:
            return


def _explanations(evidence: Evidence, robot: Robot) -> list[Explanation]:
    left, sigma = _off(evidence, robot)
    found = [_payload(evidence, robot, left, sigma, node) for node in _ends(robot)]
    found += [_scaled(evidence, robot, left, sigma, node) for node in range(len(robot.nodes))]
    found.append(_tilt(evidence, robot, left, sigma))
    return [x for x in found if x is not None]


def _off(evidence: Evidence, robot: Robot) -> tuple[Array, Array]:
    """What is off (N, R), and how much of it a sound robot may leave in each row, 1 sigma (R,)."""
    left = evidence.residual(robot)
    first = evidence.robot.gravity  # that the equations were made with
    if not np.array_equal(first, robot.gravity):
        left += held_weights(evidence, robot, robot.gravity) - held_weights(evidence, robot, first)
    largest = np.abs(evidence.reading).max(axis=0)
    noise = usual_scatter(left, evidence.used)
    return left, np.sqrt(np.maximum(OFFSET, OFFSET_SHARE * largest) ** 2 + noise**2)


def _ends(robot: Robot) -> list[int]:
    """Nodes at the end of the tree: there hands and tools are mounted."""
    parents = {node.parent for node in robot.nodes}
    return [i for i, node in enumerate(robot.nodes) if i not in parents and node.links]


def _payload(
    evidence: Evidence, robot: Robot, left: Array, sigma: Array, node: int, sure: float = SURE
) -> Explanation | None:
    A = evidence.model[:, :, node, :4]
    if not np.abs(A[:, evidence.used]).max(initial=0.0) > 0.0:
        return None
    name = payload_link(robot, node)
    T = robot.places[name].T_node_link
    expected = T[:3, 3] + 0.5 * CENTRE * T[:3, 2]
    # In terms of the mass and of the way of its centre from where a hand's would be.
    A = np.concatenate([A[..., :1] + A[..., 1:] @ expected[:, None], A[..., 1:]], axis=-1)
    prior = np.array([0.0, *np.full(3, (0.7 * CENTRE) ** -2.0)])
    values, errors, share, cost = _fit(A, left, sigma, evidence, prior)
    mass, error = float(values[0]), float(errors[0])
    if abs(mass) < max(LEAST_MASS, sure * error):
        return None
    centre = expected + np.clip(values[1:] / mass, -CENTRE, CENTRE)
    own = sum(robot.mechanism.links[x].inertia.mass for x in robot.nodes[node].links)
    if mass < 0.0 and -mass > 1.05 * own:
        return None
    place = np.linalg.inv(T) @ np.append(centre, 1.0)
    com = ", ".join(f"{x:.3f}" for x in place[:3])
    pose = "; one pose alone cannot tell it from offsets" if _one_pose(evidence) else ""
    what = f"{abs(mass):.2f} +- {max(error, 0.01):.2f} kg"
    if mass > 0:
        words = (
            f"{what} are missing at {name} ({100 * share:.0f} % of what is off{pose}): a hand or "
            f"tool that the model lacks? loads: [{{link: {name}, mass: {mass:.2f}, com: [{com}]}}]"
        )
        load = Load(name, round(mass, 3), tuple(float(round(x, 4)) for x in place[:3]))
        six = [round(1e-3 * mass, 6) * (i in (0, 3, 5)) for i in range(6)]
        entry = {"link": name, "mass": load.mass, "com": list(load.com), "inertia": six}
        short = f"{mass:.2f} kg more at {name}"
        return Explanation(words, short, share, cost, _loaded(robot, load), {"loads": [entry]})
    words = (
        f"{what} too many at {name} ({100 * share:.0f} % of what is off{pose}): a hand that is "
        f"modelled but not mounted? links: {{LINK: {{mass: 0.0}}}} for what is not there"
    )
    short = f"{-mass:.2f} kg less at {name}"
    return Explanation(words, short, share, cost, _lighter(robot, node, -mass, centre), {})


def _scaled(
    evidence: Evidence, robot: Robot, left: Array, sigma: Array, node: int
) -> Explanation | None:
    """The factor that the inertia of a node's heaviest link would need."""
    links = main_links(robot)
    if node not in links:
        return None
    name, vector = links[node]
    A = (evidence.model[:, :, node] @ vector)[..., None]
    if not np.abs(A[:, evidence.used]).max(initial=0.0) > 0.0:
        return None
    values, errors, share, cost = _fit(A, left, sigma, evidence, np.zeros(1))
    factor, error, mass = 1.0 + float(values[0]), float(errors[0]), float(vector[0])
    off = abs(factor - 1.0)
    if factor < 0.0 or off < max(LEAST_SCALE, LEAST_MASS / mass, SURE * error):
        return None
    words = (
        f"the inertia of {name} is {factor:.2f} +- {max(error, 0.01):.2f} times the model's "
        f"({100 * share:.0f} % of what is off): it weighs {factor * mass:.2f} kg, not {mass:.2f} "
        f"kg? links: {{{name}: {{mass: {factor * mass:.2f}}}}}, or calibrate"
    )
    link = robot.mechanism.links[name]
    own = link.inertia
    body = Inertia(factor * own.mass, own.com, factor * own.inertia)
    links_now = robot.mechanism.links | {name: replace(link, inertia=body)}
    short = f"{name} weighs {factor * mass:.2f} kg, not {mass:.2f} kg"
    return Explanation(
        words, short, share, cost + RARE, _with_links(robot, robot.description, links_now), {}
    )


def _tilt(evidence: Evidence, robot: Robot, left: Array, sigma: Array) -> Explanation | None:
    """The angle by which gravity would have to be turned."""
    g = robot.gravity
    size = float(np.linalg.norm(g))
    if size == 0.0:
        return None
    new, error, share, cost = _leaning(evidence, robot, left, sigma)
    angle = _between(new, g)
    if angle > MOST_TILT:
        turned = _mounted(evidence, robot, left, sigma)
        if turned is None:
            return None
        new, error, share, cost = turned
        angle = _between(new, g)
    if angle < max(LEAST_TILT, SURE * error):
        return None
    numbers = ", ".join(f"{x:.3f}" for x in new)
    words = (
        f"the base is tilted by {np.degrees(angle):.1f} +- {np.degrees(max(error, 2e-3)):.1f} "
        f"degrees ({100 * share:.0f} % of what is off): gravity: [{numbers}]"
    )
    fix = {"gravity": [round(float(x), 4) for x in new]}
    short = f"the base is tilted by {np.degrees(angle):.1f} degrees"
    return Explanation(words, short, share, cost, _under(robot, new), fix)


def _between(one: Array, other: Array) -> float:
    """The angle between two directions [rad]."""
    cosine = one @ other / (np.linalg.norm(one) * np.linalg.norm(other))
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _under(robot: Robot, gravity: Array) -> Robot:
    return Robot(robot.description, replace(robot.mechanism, gravity=gravity))


def _leaning(
    evidence: Evidence, robot: Robot, left: Array, sigma: Array
) -> tuple[Array, float, float, float]:
    """Gravity turned about the two level axes, its error [rad], share and cost."""
    ways = [np.cross(axis, robot.gravity) for axis in level_axes(robot)]
    A = np.stack([turned(evidence, robot, way) for way in ways], axis=-1)
    values, errors, share, cost = _fit(A, left, sigma, evidence, np.zeros(2))
    new = leaned(robot, values)
    return new, float(np.linalg.norm(errors)), share, cost


def _mounted(
    evidence: Evidence, robot: Robot, left: Array, sigma: Array
) -> tuple[Array, float, float, float] | None:
    """Gravity of a base on a wall or a ceiling, its error [rad], share and cost.

    Loads are linear in all of gravity, whose length is known. What this first fit leaves is a small
    tilt, with what is off then.
    """
    size = float(np.linalg.norm(robot.gravity))
    A = np.stack([turned(evidence, robot, axis) for axis in np.eye(3)], axis=-1)
    values, _, share, cost = _fit(A, left, sigma, evidence, np.zeros(3))
    new = robot.gravity + values
    length = float(np.linalg.norm(new))
    if abs(length / size - 1.0) > SIZE_OFF:
        return None
    now = _under(robot, new * size / length)
    new, error, _, _ = _leaning(evidence, now, *_off(evidence, now))
    return new, error, share, cost


def _offsets(evidence: Evidence, robot: Robot) -> list[Explanation]:
    """A bias of one joint's torque, or one of each axis of a sensor, that would be the cause."""
    left, sigma = _off(evidence, robot)
    description, n = robot.description, evidence.joints
    rows = [(joint.name, [j]) for j, joint in enumerate(description.joints)]
    for k, sensor in enumerate(description.sensors):
        rows.append((sensor.name, list(range(n + 6 * k, n + 6 * k + 6))))
    found = []
    for name, own in rows:
        own = [r for r in own if evidence.used[r]]
        if not own:
            continue
        A = np.zeros((*left.shape, len(own)))
        for i, row in enumerate(own):
            A[:, row, i] = 1.0
        values, errors, share, cost = _fit(A, left, sigma, evidence, np.zeros(len(own)))
        if share < EXPLAINED or not (np.abs(values) > SURE * errors).any():
            continue
        more = np.zeros(left.shape[1])
        more[own] = values
        torque, wrench = -more[:n], -more[n:].reshape(-1, 6)
        biased = Robot(with_offsets(description, torque, wrench), robot.mechanism)
        found.append(Explanation("", f"an offset of {name}", share, cost, biased, {}))
    return found


def _gains(evidence: Evidence, robot: Robot) -> Explanation | None:
    """The gains that motors' currents would need; None where none is off, or no motor is."""
    joints = robot.description.joints
    motors = [j for j, joint in enumerate(joints) if joint.torque == "motor" and evidence.used[j]]
    if not motors:
        return None
    left, sigma = _off(evidence, robot)
    expected = evidence.reading + left  # what the robot as it is now should read
    A = np.zeros((*left.shape, len(motors)))
    for k, j in enumerate(motors):
        A[:, j, k] = expected[:, j]
    values, errors, share, cost = _fit(A, left, sigma, evidence, np.zeros(len(motors)))
    off = [k for k in range(len(motors)) if abs(values[k]) > max(GAIN_OFF, POSSIBLE * errors[k])]
    if not off:
        return None
    told = ", ".join(f"{1.0 + values[k]:.2f} ({joints[motors[k]].name})" for k in off)
    return Explanation("", f"gains of {told}", share, cost, robot, {})


def _fit(
    A: Array, left: Array, sigma: Array, evidence: Evidence, prior: Array
) -> tuple[Array, Array, float, float]:
    """Values, standard errors, explained share of squares, and cost; an instant counts little.

    The cost is the weighed sum of squares and two for each free number (Akaike's criterion).
    """
    rows, count = evidence.used, A.shape[-1]
    poses = _poses(evidence)
    links = evidence.usual_links
    A, left = _without_unknowns(np.concatenate([A, links], axis=-1), left, sigma, poses, evidence)
    both = (A[:, rows] / sigma[rows][:, None]).reshape(-1, A.shape[-1])
    X, y = both[:, :count], (left[:, rows] / sigma[rows]).ravel()
    weight = poses / len(evidence)  # instants in one pose repeat each other
    normal = weight * both.T @ both + np.diag([*prior, *np.ones(links.shape[-1])])
    values = -np.linalg.pinv(normal[:count, :count]) @ (weight * X.T @ y)
    # Links that are off as usual err alike in all poses: more poses make nothing surer.
    errors = unit_errors(normal)[:count]
    rest = y + X @ values
    share = 1.0 - float(rest @ rest) / max(float(y @ y), 1e-12)
    cost = weight * float(rest @ rest) + 2.0 * len(values)
    return values, errors, share, cost


def _without_friction(values: Array, evidence: Evidence) -> Array:
    """Columns (N, R, c) without what unknown friction, and rotors of motors, could make of them."""
    out = values.copy()
    if evidence.joints == 0:
        return out
    width = WIDTHS.index(COULOMB_WIDTH)
    for j in range(evidence.joints):
        if evidence.used[j] and np.std(evidence.speed[:, j]) > MOVED:
            columns = [evidence.dry[:, j, width], evidence.speed[:, j]]
            joint = evidence.robot.description.joints[j]
            if joint.torque == "motor" and not joint.rotor_inertia:
                columns.append(evidence.rotor[:, j])
            rubbing = np.column_stack(columns)
            out[:, j] -= rubbing @ np.linalg.lstsq(rubbing, out[:, j], rcond=None)[0]
    return out


def _without_unknowns(
    A: Array, left: Array, sigma: Array, poses: float, evidence: Evidence
) -> tuple[Array, Array]:
    """Columns (N, R, c) and what is left (N, R) without what is not known of a joint's torque.

    Friction may be of any size. What it leaves of itself, and the gain of a motor's current, are
    small unknowns: they are taken out as far as the data tell more of them than is known before.
    """
    both = np.concatenate([A, left[..., None]], axis=-1)
    smooth = _without_friction(both, evidence)
    weight = poses / len(evidence)
    for j, joint in enumerate(evidence.robot.description.joints):
        rubbing = float(np.sqrt(np.mean((both[:, j, -1] - smooth[:, j, -1]) ** 2)))
        if joint.torque != "motor" or not evidence.used[j]:
            continue
        unknown = np.zeros((len(evidence), evidence.reading.shape[1], 2))
        unknown[:, j, 0] = UNEVEN * rubbing
        unknown[:, j, 1] = GAIN * evidence.load[:, j]
        columns = _without_friction(unknown, evidence)[:, j] / sigma[j]
        Q, s, _ = np.linalg.svd(columns, full_matrices=False)
        # The root of the inverse covariance of white noise and these unknowns together.
        smaller = 1.0 - 1.0 / np.sqrt(1.0 + weight * s**2)
        smooth[:, j] -= Q @ (smaller[:, None] * (Q.T @ smooth[:, j]))
    return smooth[..., :-1], smooth[..., -1]


def _poses(evidence: Evidence) -> float:
    """How many poses that differ the recording shows, roughly."""
    cells = np.unique(np.round(evidence.q / 0.3), axis=0)
    return float(len(cells))


def _one_pose(evidence: Evidence) -> bool:
    return bool(np.ptp(evidence.q, axis=0).max(initial=0.0) < ONE_POSE)


def _loaded(robot: Robot, load: Load) -> Robot:
    link = robot.mechanism.links[load.link]
    ball = Inertia(load.mass, np.array(load.com), 1e-3 * load.mass * np.eye(3))
    links = robot.mechanism.links | {
        load.link: replace(link, inertia=combine_inertias([link.inertia, ball]))
    }
    return _with_links(robot, robot.description, links)


def _lighter(robot: Robot, node: int, mass: float, centre: Array) -> Robot:
    """The robot with a mass [kg] taken off a node's links at a centre (3,) [m] in its frame.

    Of what is left only mass and centre are told; its inertia becomes smaller as its mass does.
    """
    names = robot.nodes[node].links
    own = robot.nodes[node].inertia
    left = max(own.mass - mass, 0.0)
    factor = left / own.mass
    middle = (own.mass * own.com - mass * centre) / left if factor > LIGHT else own.com
    links = dict(robot.mechanism.links)
    for name in names:
        body = links[name].inertia
        shift = robot.places[name].T_node_link[:3, :3].T @ (middle - own.com)
        links[name] = replace(
            links[name],
            inertia=Inertia(factor * body.mass, body.com + shift, factor * body.inertia),
        )
    return _with_links(robot, robot.description, links)


def _with_links(robot: Robot, description: RobotDescription, links: dict) -> Robot:
    return Robot(description, replace(robot.mechanism, links=links))
