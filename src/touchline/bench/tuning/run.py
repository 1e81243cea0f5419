# SPDX-License-Identifier: Apache-2.0
"""Halves and doubles each tuning number, one at a time, and prints what that does."""

import json
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from touchline.bench.tables import aligned
from touchline.bench.tuning.effect import Outcome, effect, outcome
from touchline.bench.tuning.recordings import Recording, recordings
from touchline.errors import InputError
from touchline.folder import check_file, replaced_file
from touchline.suggest import unknown
from touchline.tuning import DEFAULTS

FAULTY = ("gates", "observer")  # modules whose numbers are tried on faults of channels too
FACTORS = {"half": 0.5, "double": 2.0}


def main(names: Sequence[str], out: Path | None) -> None:
    """Print a line for each number; `out` gets all of them as JSON.

    Raises:
        InputError: there is no number or module of that name.
    """
    chosen = [name for wanted in names for name in _numbers(wanted)] or list(DEFAULTS)
    if out is not None:
        check_file(out, "--out")
    healthy, faulty = recordings()
    usual = {module: outcome(_of(module, healthy, faulty), {}) for module in ("gates", "place")}
    everything = usual["gates"].text()
    print(everything)
    found: dict[str, dict[str, str]] = {}
    for name in tqdm(chosen, desc="numbers", unit="", disable=None):
        found[name] = {
            which: _tried(name, factor, healthy, faulty, usual) for which, factor in FACTORS.items()
        }
    rows = [("number", "default", "half", "double")]
    rows += [(name, f"{DEFAULTS[name]:g}", *found[name].values()) for name in chosen]
    print(aligned(rows, (0, 2, 3)))
    summary = summarized(found)
    print(summary)
    if out is not None:
        told = {
            "recordings": [r.name for r in (*healthy, *faulty)],
            "default": everything,
            "summary": summary,
            "numbers": found,
        }
        with replaced_file(out) as draft:
            draft.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")


def summarized(found: dict[str, dict[str, str]]) -> str:
    """How many numbers have an effect, in words."""
    none = sum(set(effects.values()) == {"="} for effects in found.values())
    small = sum(set(effects.values()) <= {"=", "~"} for effects in found.values()) - none
    return (
        f"Of {len(found)} numbers {none} change nothing here by half or double, {small} change "
        f"events but no figure, and {len(found) - none - small} change a figure."
    )


def _numbers(wanted: str) -> list[str]:
    own = [name for name in DEFAULTS if wanted in (name, name.split(".")[0])]
    if not own:
        raise InputError(unknown(wanted, "tuning number", DEFAULTS))
    return own


def _of(module: str, healthy: list[Recording], faulty: list[Recording]) -> list[Recording]:
    return [*healthy, *faulty] if module in FAULTY else healthy


def _tried(
    name: str,
    factor: float,
    healthy: list[Recording],
    faulty: list[Recording],
    usual: dict[str, Outcome],
) -> str:
    module = name.split(".", maxsplit=1)[0]
    value = factor * DEFAULTS[name]
    if isinstance(DEFAULTS[name], int):
        value = max(1, round(value))
    before = usual["gates" if module in FAULTY else "place"]
    return effect(before, outcome(_of(module, healthy, faulty), {name: value}))
