# SPDX-License-Identifier: Apache-2.0
"""Offsets so large that a touch which never ends may be their cause."""

from collections.abc import Iterator

import numpy as np

from touchline.arrays import Index
from touchline.identify.identification import Identification

# Of the largest torque or force that the model expects in such a row. Offsets of the recorded real
# arms (Panda, UR10, KUKA LWR4+) are 0.01 to 0.02 of it; 15 N on a Panda's flange makes 0.1.
SHARE = 0.05
LEAST = 0.1  # N or Nm; less matters little
SURE = 3.0  # standard errors


def lasting_lines(found: Identification) -> list[str]:
    """One sentence on the offsets that a touch or a load throughout would look like."""
    e, told = found.evidence, []
    untouched = ~found.touched
    for rows, unit in _groups(found):
        expected = float(np.abs(e.load[np.ix_(untouched, rows)]).max(initial=0.0))
        for row in rows:
            offset, error = (of("bias", row) for of in (found.solution.value, found.solution.error))
            if abs(offset) > max(SHARE * expected, LEAST, SURE * error):
                told.append(f"{e.rows.names[row]} ({offset:+.3g} {unit})")
    if not told:
        return []
    are = "is a large offset" if len(told) == 1 else "are large offsets"
    return [
        f"{', '.join(told)} {are}, above {100 * SHARE:g} % of what the model expects at most; "
        "a touch or a load\n  that lasted all through the recording would look the same"
    ]


def _groups(found: Identification) -> Iterator[tuple[Index, str]]:
    """Rows that are compared with each other, and their unit."""
    e = found.evidence
    starts = range(e.joints, len(e.used), 6)
    groups = [(0, e.joints, "Nm")]
    groups += [x for first in starts for x in ((first, 3, "N"), (first + 3, 3, "Nm"))]
    for first, count, unit in groups:
        rows = np.arange(first, first + count)
        yield rows[e.used[rows]], unit
