# SPDX-License-Identifier: Apache-2.0
"""A body that the model lacks at the end of the arm: a hand, a tool, a grasped object."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.identify.evidence import PER_CONSTANT, Evidence, gather
from touchline.identify.fit import BodyChange, Equations, Problem, Solution
from touchline.identify.regressor import PARAMETERS, body_of_vector, body_vector
from touchline.identify.touches import usual_scatter
from touchline.model.mechanism import Inertia
from touchline.model.robot import Robot
from touchline.model.transforms import move_inertia
from touchline.model.tree import invert
from touchline.observer.samples import Samples
from touchline.suggest import unknown

LIGHTEST = 0.03  # kg; less is left to the links' own corrections
SURE = 4.0  # standard errors of the mass
FARTHEST = 0.25  # m from the flange; a mass centred farther off is an error of the links
RADIUS = 0.05  # m, of gyration of a first guess
SIGMA = 0.3  # prior of the steps from a first guess
FLOOR = 0.002  # of a row's largest reading: no model foretells more closely
ROUNDS = 4  # of fitting and weighing rows by what is left of them
SETTLED = 0.01  # the same, once it has been fitted beside links that are as modelled
# Beside a load, 1 sigma of a row: links that are off as usual, and what offsets and friction leave
# of a sound robot [N, Nm]. On simulated arms with links 3 % off a load leaves less than half of the
# bound; a hand of 15 N, an offset of 10 N and a stuck sensor leave more (tests/identify).
MOST_LEFT, SOUND = 5.0, 0.3
CENTRE_SIGMA = 0.1  # m, prior of the centre, so that mass and offsets part where the data can


def leaf_nodes(robot: Robot) -> list[int]:
    """Nodes that carry links but no further nodes."""
    parents = {node.parent for node in robot.nodes}
    return [i for i, node in enumerate(robot.nodes) if i not in parents and node.links]


def payload_link(robot: Robot, node: int) -> str:
    """The link that a payload is fixed to: the flange, the first one of no mass, if there is one.

    Otherwise the node's heaviest link.
    """
    links = [robot.mechanism.links[name] for name in robot.nodes[node].links]
    heaviest = max(links, key=lambda link: link.inertia.mass)
    beyond = links[links.index(heaviest) + 1 :]
    flange = next((x for x in beyond if x.inertia.mass == 0.0 and not x.virtual), heaviest)
    return flange.name


def guess_payload(equations: Equations, node: int) -> BodyChange | None:
    """A first guess at a payload by plain least squares; None where the data show none.

    Args:
        equations: with the columns that may be wrong as well, and the node among the bodies.
        node: that carries it.
    """
    problem = equations.problem
    linear = len(problem.columns)
    first = linear + PARAMETERS * [b.node for b in problem.bodies].index(node)
    index = np.array([*range(linear), *range(first, first + 4)])
    normal = equations.normal[np.ix_(index, index)].copy()
    prior = np.concatenate([equations.only(Problem(problem.columns)).prior(), np.zeros(4)])
    prior[linear + 1 :] = CENTRE_SIGMA**-2.0
    normal += np.diag(prior)
    covariance = np.linalg.pinv(normal)
    found = -covariance @ equations.gradient[index]
    mass, error = float(found[linear]), float(np.sqrt(covariance[linear, linear]))
    if mass < LIGHTEST or mass < SURE * error:
        return None
    centre = found[linear + 1 :] / mass
    robot = equations.evidence.robot
    flange = robot.places[payload_link(robot, node)].T_node_link[:3, 3]
    if np.linalg.norm(centre - flange) > FARTHEST:
        return None
    ball = Inertia(mass, centre, mass * RADIUS**2 * np.eye(3))
    return BodyChange(node, body_vector(ball), SIGMA, added=True)


def payload_mass(found: Solution) -> tuple[float, float]:
    """Mass of all payloads of a solution and its standard error [kg]; zeros without any."""
    pairs = zip(found.problem.bodies, found.changes(), found.body_errors, strict=True)
    loads = [(change[0], error[0]) for body, change, error in pairs if body.added]
    return float(sum(m for m, _ in loads)), float(np.sqrt(sum(e**2 for _, e in loads)))


def seen_leaves(evidence: Evidence) -> list[int]:
    """Leaf nodes whose weight or motion some row feels."""
    model, used = evidence.model, evidence.used
    return [i for i in leaf_nodes(evidence.robot) if np.abs(model[:, used, i]).max(initial=0.0) > 0]


def _links_doubt(
    evidence: Evidence, A: Array, rest: Array, weight: Array, covariance: Array
) -> Array:
    """What links that are off add to the covariance (4, 4) of a load beside them.

    How far they are off is told by what the load leaves: as many times as much as links that are
    off as usual would leave beside it.
    """
    root = np.sqrt(weight[:, evidence.used])[..., None]
    X = (A[:, evidence.used] * root).reshape(-1, 4)
    U = evidence.usual_links[:, evidence.used] * root
    U = U.reshape(len(X), -1)
    taken = covariance @ (X.T @ U)  # (4, c) of each link's error ends in the load
    usual = float(((U - X @ taken) ** 2).sum())
    shown = float((rest[:, evidence.used] ** 2 * root[..., 0] ** 2).sum())
    return taken @ taken.T * (shown / usual if usual > 0.0 else 1.0)


def _unlike_load(evidence: Evidence, rest: Array) -> str:
    """What a load leaves (N, R) and should not, in a sentence; empty where it is as usual."""
    left = np.sqrt(np.mean(rest**2, axis=0))
    usual = np.sqrt(np.mean(np.sum(evidence.usual_links**2, axis=-1), axis=0))
    far = np.where(evidence.used, left / np.hypot(usual, SOUND), 0.0)
    row = int(np.argmax(far))
    if far[row] <= MOST_LEFT:
        return ""
    name = evidence.rows.names[row]
    unit = "N" if row >= evidence.joints and (row - evidence.joints) % 6 < 3 else "Nm"
    return (
        f"{left[row]:.3g} {unit} are left in {name}, where a sound arm leaves "
        f"{np.hypot(usual[row], SOUND):.2g} {unit}: something touches the arm, a sensor fails, its "
        "offset has changed, or the load came or went meanwhile. Keep clear of it, or calibrate"
    )


@dataclass(frozen=True)
class WeighedLoad:
    """A body that was identified on the link that carries it.

    Attributes:
        link: that it is fixed to.
        mass: [kg], and `mass_error`, its standard error.
        com: (3,) centre in the link's frame [m], and `com_error`, the largest standard error of it.
        doubt: what a load alone does not leave, in a sentence; empty where there is nothing.
    """

    link: str
    mass: float
    mass_error: float
    com: Array
    com_error: float
    doubt: str = ""


def weigh_load(robot: Robot, samples: Iterable[Samples], link: str) -> WeighedLoad:
    """Mass and centre of what a link carries beyond its description, from free motion.

    Biases count as right: tare, or calibrate, before the gripper closes. A few seconds that turn
    the link against gravity are enough; in one posture the centre stays unknown along the force.

    Args:
        robot: as described, without the body.
        samples: parts of one recording in which nothing else touches the arm.
        link: that carries the body.

    Raises:
        InputError: there is no such link, the samples are too few, or show no body there.
    """
    if link not in robot.places:
        raise InputError(unknown(link, "link", list(robot.places)))
    try:
        evidence = gather(robot, [samples])
    except ValueError as error:
        raise InputError(f"no load on {link}: {error}") from None
    node = robot.places[link].node
    if not np.abs(evidence.model[:, evidence.used, node]).max(initial=0.0) > 0.0:
        raise InputError(f"no load on {link}: no torque or sensor that is measured feels it")
    left, use = evidence.residual(), np.ones(len(evidence), dtype=bool)
    unit = Inertia(1.0, np.zeros(3), RADIUS**2 * np.eye(3))
    problem = Problem((), (BodyChange(node, body_vector(unit), SIGMA, added=True),))
    prior = np.diag([0.0, *np.full(3, CENTRE_SIGMA**-2.0)])
    least = FLOOR * np.abs(evidence.reading).max(axis=0, initial=0.0)
    four, rest = np.zeros(4), left  # mass, and mass times centre
    covariance, weight, turning = np.zeros((4, 4)), np.ones(left.shape), np.zeros(6)
    own = evidence.model[:, :, node]
    for _ in range(ROUNDS):
        sigma = np.maximum(usual_scatter(rest, evidence.used), np.maximum(least, 1e-6))
        weight = np.broadcast_to(sigma**-2.0, left.shape)
        turned = left + own[..., 4:] @ turning
        equations = Equations.of(evidence, problem, turned, weight, use)
        covariance = np.asarray(np.linalg.pinv(equations.normal[:4, :4] + prior), float)
        four = -covariance @ equations.gradient[:4]
        rest = turned + own[..., :4] @ four
        if four[0] > SURE * np.sqrt(covariance[0, 0]):  # as a ball about its centre turns
            ball = Inertia(four[0], four[1:] / four[0], four[0] * RADIUS**2 * np.eye(3))
            turning = body_vector(ball)[4:]
    spread = max(1.0, float(np.mean((rest**2 * weight)[:, evidence.used])))
    doubt = _links_doubt(evidence, own[..., :4], rest, weight, covariance)
    covariance = covariance * spread * 2.0 * PER_CONSTANT  # instants closer than that repeat
    covariance = covariance + doubt
    mass, error = float(four[0]), float(np.sqrt(covariance[0, 0]))
    unlike = _unlike_load(evidence, rest)
    if mass < SURE * error:
        raise InputError(
            f"no load on {link}: {mass:+.3f} kg with a standard error of {error:.3f} kg; "
            + (unlike or "move the link against gravity for a few seconds")
        )
    body = body_of_vector(np.array([*four, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    T_link_node = invert(robot.places[link].T_node_link)
    centre = move_inertia(body, T_link_node).com
    centre_errors = np.sqrt(np.diag(covariance)[1:] + (four[1:] / mass * error) ** 2) / mass
    return WeighedLoad(link, mass, error, centre, float(centre_errors.max()), unlike)
