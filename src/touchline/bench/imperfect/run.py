# SPDX-License-Identifier: Apache-2.0
"""Pushes of 20 N on arms that are not as told, standing and in motion; nothing is calibrated."""

from collections.abc import Sequence

import numpy as np

from touchline.bench.imperfect.faults import FAULTS
from touchline.bench.imperfect.trial import Outcome, Trials
from touchline.bench.tables import Row, aligned
from touchline.trials.arms import load_arm

ARMS = ("sara", "panda", "ur5")
NOISE = 1  # tier of the localization benchmark: 0.05 N, 0.01 Nm, 0.05 Nm
REGION = 0.9  # the probability of the regions that are judged
HEAD = (
    *("arm", "what is wrong", "", "located before", "found", "wrong place", "cleared", "events"),
    "90 % holds",
)


def main(arms: Sequence[str], runs: int, seed: int) -> None:
    """Prints a line for each arm, fault, and for standing and moving.

    Args:
        arms: names, see `load_arm`.
        runs: pushes per line.
        seed: of all that is random.
    """
    rows: list[Row] = [HEAD]
    both: dict[tuple[str, str], list[Outcome]] = {}
    for a, name in enumerate(arms):
        trials = Trials(load_arm(name, NOISE))
        for f, fault in enumerate(FAULTS):
            for moving in (False, True):
                played = [trials.play(fault, moving, (seed, a, f, moving, k)) for k in range(runs)]
                line = fault.name, "moving" if moving else "standing"
                rows.append((name, *line, *_told(played)))
                both.setdefault(line, []).extend(played)
    if len(arms) > 1:
        rows += [("all", *line, *_told(played)) for line, played in both.items()]
    print("Pushes of 20 N for 0.8 s on arms that are not as told and not calibrated:")
    print(aligned(rows))


def _told(played: list[Outcome]) -> tuple[str, ...]:
    def share(part: int) -> str:
        return f"{part}/{len(played)}"

    return (
        share(sum(o.before for o in played)),
        share(sum(o.found for o in played)),
        share(sum(o.wrong for o in played)),
        share(sum(o.cleared for o in played)),
        f"{sum(o.events for o in played) / len(played):.1f}",
        _holds([o.level for o in played if np.isfinite(o.level)]),
    )


def _holds(levels: list[float]) -> str:
    """Share of the regions that hold the place."""
    return f"{100 * np.mean(np.array(levels) < REGION):.0f} %" if levels else "-"
