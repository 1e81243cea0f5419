# SPDX-License-Identifier: Apache-2.0
"""What links make of each row that are off as usual: by what no recording can be surer."""

import numpy as np

from touchline.arrays import Array
from touchline.identify.evidence import Evidence
from touchline.identify.regressor import body_vector
from touchline.localizer.localizer import MODEL_ERROR

# Masses and inertias err by `MODEL_ERROR`, 1 sigma, centres by the same part of a link's width.
LINK_WIDTH = 0.1  # m


def usual_links(evidence: Evidence) -> Array:
    """(N, R, c) [N or Nm] what 1 sigma of each link's mass and centre adds to the rows."""
    columns = []
    for i, node in enumerate(evidence.robot.nodes):
        body = node.inertia
        if body.mass > 0.0:
            columns.append(MODEL_ERROR * evidence.model[:, :, i] @ body_vector(body))
            shifts = evidence.model[:, :, i, 1:4] * (MODEL_ERROR * LINK_WIDTH * body.mass)
            columns += list(np.moveaxis(shifts, -1, 0))
    return np.stack(columns, axis=-1) if columns else np.zeros((*evidence.reading.shape, 0))
