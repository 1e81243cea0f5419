# SPDX-License-Identifier: Apache-2.0
"""What links make of each row that are off as usual: by what no recording can be surer."""

import numpy as np

from touchline.arrays import Array
from touchline.identify.evidence import Evidence
from touchline.identify.regressor import body_vector

# As the localizer takes models, 1 sigma. Masses and inertias err by this part, centres by the same
# part of a link's width.
LINKS_OFF, LINK_WIDTH = 0.02, 0.1  # relative, m


def usual_links(evidence: Evidence) -> Array:
    """(N, R, c) [N or Nm] what 1 sigma of each link's mass and centre adds to the rows."""
    columns = []
    for i, node in enumerate(evidence.robot.nodes):
        body = node.inertia
        if body.mass > 0.0:
            columns.append(LINKS_OFF * evidence.model[:, :, i] @ body_vector(body))
            shifts = evidence.model[:, :, i, 1:4] * (LINKS_OFF * LINK_WIDTH * body.mass)
            columns += list(np.moveaxis(shifts, -1, 0))
    return np.stack(columns, axis=-1) if columns else np.zeros((*evidence.reading.shape, 0))
