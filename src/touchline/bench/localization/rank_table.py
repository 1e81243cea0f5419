# SPDX-License-Identifier: Apache-2.0
"""Two contacts that begin together, by how many equations there are for them."""

from collections.abc import Iterable

import numpy as np

from touchline.bench.localization.trial import UNKNOWNS, Trial
from touchline.bench.tables import Row, aligned
from touchline.trials.arms import TIERS


def rank_table(trials: Iterable[Trial]) -> str:
    """Pairs that begin together, by the rank of their equations; empty without such pairs."""
    pairs = [
        trial for trial in trials if trial.cell.begin == "together" and trial.cell.contacts == 2
    ]
    if not pairs:
        return ""
    rows: list[Row] = [
        ("arm", "noise", "rank", "free", "pairs", "found", "truth in the set", "confidently wrong",
         "surface named", "surface allowed")
    ]  # fmt: skip
    keys = sorted({(trial.cell.arm, trial.cell.tier, trial.rank) for trial in pairs})
    for arm, tier, rank in keys:
        own = [t for t in pairs if (t.cell.arm, t.cell.tier, t.rank) == (arm, tier, rank)]
        rates = [[t.found for t in own], [t.in_set for t in own],
                 [t.confidently_wrong for t in own]]  # fmt: skip
        shares = [f"{100 * np.mean(rate):.2f} %" for rate in rates]
        surfaces = [
            _share([t.named_surface for t in own]),
            _share([t.allowed_surface for t in own]),
        ]
        name, free = (str(rank), str(max(0, UNKNOWNS - rank))) if rank else ("apart", "-")
        rows.append((arm, str(TIERS[tier]), name, free, str(len(own)), *shares, *surfaces))
    return f"{aligned(rows, text_columns=(0, 1))}\n{LEGEND}"


LEGEND = """\
Rank: independent equations of a pair on one segment. Two contacts need 10, and `free` is what is
left. Surface named: share of the segment's surface in the parts that the answer names. Surface
allowed: share that two contacts may touch, by exact readings (where one equation is missing:
within 5 mm of a curve)."""


def _share(values: list[float]) -> str:
    known = np.array(values)[np.isfinite(values)]
    return f"{100 * known.mean():.2f} %" if len(known) else "-"
