# SPDX-License-Identifier: Apache-2.0
"""The rows of `contacts.parquet`: one per contact and sample."""

from typing import Any

import numpy as np

from touchline.contact.table import ContactTable
from touchline.estimation.observer import Estimate
from touchline.model.description import AXES

POSITION = ("x", "y", "z")
COVARIANCE = ("pxx", "pxy", "pxz", "pyy", "pyz", "pzz")
CONTACT_SCHEMA: dict[str, Any] = (
    {"time": "f8", "health": "u4", "event": "i8", "segment": "str", "link": "str", "body": "str"}
    | {"body_probability": "f8", "status": "str"}
    | dict.fromkeys((*POSITION, *AXES, "position_std", *COVARIANCE), "f8")
)


def contact_rows(time: np.ndarray, estimate: Estimate, table: ContactTable) -> dict[str, Any]:
    """The columns of `CONTACT_SCHEMA`.

    The force is that of the contact; the moments are those of the segment's wrench about the world
    origin.

    Args:
        time: (N,) [s].
        estimate: of the same N samples.
        table: of the contacts in these samples.
    """
    sample = table.sample
    columns: dict[str, Any] = {"time": time[sample], "health": estimate.health[sample].astype("u4")}
    columns |= table.columns()
    moments = estimate.segment_wrench[sample, table.segment, 3:]
    return columns | dict(zip(AXES[3:], moments.T, strict=True))
