# SPDX-License-Identifier: Apache-2.0
"""What a fit changes in postures that the arm has not shown, and how sure that is.

Where few joints move, an offset and a mass read alike. A large payload beside large offsets then
foretells the recording, its held-out part too, and is far off everywhere else.
"""

import numpy as np

from touchline.arrays import Array, Index
from touchline.identify.evidence import Evidence
from touchline.identify.fit import BodyChange, Equations, Problem, Solution
from touchline.identify.regressor import PARAMETERS, momentum_regressors

POSTURES = 100  # random ones, at rest; the mean over them is good to a tenth
# Times what was off where the arm was, or what links as modelled may be off elsewhere. Of fits to
# motion of all joints it is at most 1.2 (simulated) and 0.8 (real arms), to motion of one 11 to 85.
MOST = 1.5
FAR = 5.0  # the same, however sure a fit is: links that err make it look surer than it is


class Elsewhere:
    """Random postures of a robot, and what its free numbers do there.

    Args:
        evidence: of the recordings; its postures play no part.
        links: the links as modelled, with what their inertias may be off.
    """

    def __init__(self, evidence: Evidence, links: tuple[BodyChange, ...]) -> None:
        self._evidence = evidence
        robot, rng = evidence.robot, np.random.default_rng(0)
        q = rng.uniform(*robot.ranges, (POSTURES, len(robot.joint_names)))
        self._model = momentum_regressors(robot, evidence.rows, q, np.zeros_like(q))[1]
        self._groups = row_groups(evidence)
        J = Problem((), links)
        size = PARAMETERS * len(links)
        nothing = Equations(evidence, J, np.zeros((size, size)), np.zeros(size))
        root = nothing.jacobian_at_start() / np.sqrt(nothing.whole_prior())
        self.doubt = self._sizes(np.sqrt(((self._terms(J) @ root) ** 2).sum(axis=2)))

    def stretched(self, found: Solution, equations: Equations, before: Array) -> bool:
        """Does a fit change more there than the recordings can vouch for?

        Args:
            found: the fit.
            equations: of the same columns and bodies, first in the same order, and of the links
                beside these: what may be off as well counts as doubt.
            before: (R,) RMS of the residuals that were to be explained [N or Nm].
        """
        x = np.concatenate([found.values, found.changes().ravel()])
        change = self._sizes(self._terms(found.problem) @ x)
        steps = np.zeros((len(equations.problem.bodies), PARAMETERS))
        steps[: len(found.steps)] = found.steps
        J = equations.jacobian(steps)
        H = J.T @ equations.normal @ J + np.diag(equations.whole_prior())
        terms = self._terms(equations.problem) @ J
        variance = np.einsum("nri,ij,nrj->nr", terms, np.linalg.pinv(H), terms)
        sigma = self._sizes(np.sqrt(np.maximum(variance, 0.0)))
        inside = np.array([float(before[group].sum()) for group in self._groups])
        times = change / np.maximum(np.maximum(inside, self.doubt), 1e-12)
        return bool(((times > FAR) | ((times > MOST) & (sigma > self.doubt))).any())

    def _terms(self, problem: Problem) -> Array:
        """(POSTURES, R, free numbers): columns, then ten parameters of each body."""
        linear = len(problem.columns)
        size = linear + PARAMETERS * len(problem.bodies)
        terms = np.zeros((*self._model.shape[:2], size))
        for i, column in enumerate(problem.columns):
            if column.kind == "bias":  # at rest nothing else is felt
                terms[:, column.row, i] = 1.0
        for i, body in enumerate(problem.bodies):
            at = linear + PARAMETERS * i
            terms[:, :, at : at + PARAMETERS] = self._model[:, :, body.node]
        return terms

    def _sizes(self, values: Array) -> Array:
        """RMS over postures of values (POSTURES, R), summed over rows of a unit and place."""
        size = np.sqrt((values**2).mean(axis=0))
        return np.array([float(size[group].sum()) for group in self._groups])


def row_groups(evidence: Evidence) -> list[Index]:
    """Rows that are judged together: the torques, the forces and the moments."""
    rows = np.flatnonzero(evidence.used)
    joint, moment = rows < evidence.joints, (rows - evidence.joints) % 6 > 2
    groups = rows[joint], rows[~joint & ~moment], rows[~joint & moment]
    return [group for group in groups if len(group)]
