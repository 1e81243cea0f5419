# SPDX-License-Identifier: Apache-2.0
"""Every touch of the localization benchmark as a table."""

import csv
from collections.abc import Sequence
from pathlib import Path

from touchline.bench.localization.trial import Trial


def write_trials(path: Path, trials: Sequence[Trial]) -> None:
    """Writes one row per touch (.csv)."""
    rows = [row for trial in trials for row in _flat(trial)]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(dict.fromkeys(key for row in rows for key in row)))
        writer.writeheader()
        writer.writerows(rows)


def _flat(trial: Trial) -> list[dict]:
    common = {
        "run": trial.run,
        "rank": trial.rank,
        "named": trial.named,
        "events": trial.events,
        "found": trial.found,
        **vars(trial.course),
    }
    rows = []
    for i, touch in enumerate(trial.touches):
        other = {f"error_{name}": errors[i] for name, errors in trial.baselines}
        rows.append({**vars(trial.cell), **common, "contact": i, **vars(touch), **other})
    return rows
