# SPDX-License-Identifier: Apache-2.0
"""A body that the model lacks at the end of the arm: a hand, a tool, a grasped object."""

import numpy as np
from numpy.typing import NDArray

from touchline.identify.evidence import Evidence
from touchline.identify.fit import BodyChange, Equations, Problem, Solution
from touchline.identify.regressor import PARAMETERS, body_vector
from touchline.model.mechanism import Inertia
from touchline.model.robot import Robot

Array = NDArray[np.float64]

LIGHTEST = 0.03  # kg; less is left to the links' own corrections
SURE = 4.0  # standard errors of the mass
FARTHEST = 0.25  # m from the flange; a mass centred farther off is an error of the links
RADIUS = 0.05  # m, of gyration of a first guess
SIGMA = 0.3  # prior of the steps from a first guess
SETTLED = 0.01  # the same, once it has been fitted beside links that are as modelled
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
