# SPDX-License-Identifier: Apache-2.0
"""`touchline bench wrench`: the wrench on each segment by every route, on the same logs.

The logs are MuJoCo's, of the shipped arm `sara-full`; Pinocchio and iDynTree read one URDF of it.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from touchline.bench.request import prepare_results
from touchline.bench.wrench.methods import METHODS, Method
from touchline.bench.wrench.scenarios import Scenario, scenarios
from touchline.bench.wrench.scores import DEFAULT, MARGIN, TIE, Outcome, run_scenario
from touchline.bench.wrench.stage import Stage
from touchline.bench.wrench.tables import link_table, scenario_table, tally, write_tables
from touchline.errors import InputError
from touchline.model.robot import load_robot
from touchline.numbers import check_least

ROBOT = "sara-full"  # a torque sensor in every joint, without which the classical route is lost
RULES = f"""\
Errors are those of the estimated wrench against the true one at the same instant, lag included;
moments about each segment's sensor. Sensors have the noise of the description. Each method has
the bandwidth, out of one list, with which the RMS of its force is least (impacts: the error of
the peak). Where nothing touches the longest filter always looks best, so none is longer than
with {DEFAULT:g} rad/s there, and the 99.9 % level of the force decides.
Shipped: ours with {DEFAULT:g} rad/s throughout. Best: the lowest of what a robot can run, and those
within {100 * (TIE - 1):.0f} % of it. Verdict: segment against the best real peer.
An impact is detected when the force exceeds {MARGIN:g} times the largest
that the method reported before, while nothing touched."""


@dataclass(frozen=True)
class WrenchBenchmark:
    """Everything that one run found; `str()` is what is printed.

    Attributes:
        methods: that were run.
        outcomes: of the scenarios.
        notes: a line for each peer that is missing.
        seed: of motions, places and noise.
    """

    methods: Sequence[Method]
    outcomes: Sequence[Outcome]
    notes: Sequence[str]
    seed: int

    def __str__(self) -> str:
        width = max(len(m.name) for m in self.methods)
        parts = [
            f"wrench benchmark: {ROBOT} in MuJoCo, seed {self.seed}",
            "\n".join(f"{m.name.ljust(width)}  {m.title}" for m in self.methods),
            *(["\n".join(self.notes)] if self.notes else []),
            RULES,
        ]
        for outcome in self.outcomes:
            parts.append(scenario_table(outcome, self.methods))
            if len(outcome.touched) > 1:
                parts.append(link_table(outcome, self.methods))
        return "\n\n".join([*parts, tally(self.outcomes, self.methods)])


def run_benchmark(seed: int = 0, names: Sequence[str] = ()) -> WrenchBenchmark:
    """Runs the scenarios with a progress bar on stderr; the same seed gives the same numbers.

    Args:
        seed: of motions, places and noise.
        names: of scenarios; none: all.

    Raises:
        InputError: an unknown scenario.
    """
    from tqdm import tqdm

    chosen = _chosen(scenarios(Stage(load_robot(ROBOT), seed)), names)
    methods = [method for method in METHODS if not method.missing]
    notes = list(dict.fromkeys(method.missing for method in METHODS if method.missing))
    outcomes = []
    total = len(chosen) * len(methods)
    with tqdm(total=total, file=sys.stderr, disable=None, dynamic_ncols=True, leave=False) as bar:
        for scenario in chosen:

            def tick(method: str, scenario: Scenario = scenario) -> None:
                bar.set_description(f"{scenario.name}: {method}")
                bar.update()

            outcomes.append(run_scenario(scenario, methods, tick))
    return WrenchBenchmark(methods, outcomes, notes, seed)


def _chosen(known: Sequence[Scenario], names: Sequence[str]) -> list[Scenario]:
    by_name = {scenario.name: scenario for scenario in known}
    unknown = [name for name in names if name not in by_name]
    if unknown:
        raise InputError(f"unknown scenario '{unknown[0]}'; there are: {'; '.join(by_name)}")
    return [by_name[name] for name in names] if names else list(known)


def main(out: Path | None = None, seed: int = 0) -> None:
    """Prints the benchmark, and writes tables and figures into a directory if one is given.

    Raises:
        InputError: the directory cannot be made.
        ModuleNotFoundError: figures are wanted and matplotlib is missing.
    """
    check_least(0, seed=seed)
    prepare_results(out)
    result = run_benchmark(seed)
    print(result)
    if out is not None:
        from touchline.bench.wrench.figure import save_figures

        (out / "wrench.txt").write_text(f"{result}\n", encoding="utf-8")
        write_tables(out, result.outcomes, result.methods)
        stage = Stage(load_robot(ROBOT), seed)
        save_figures(out, result.outcomes, result.methods, stage)
        print(f"\nTables and figures are in {out}")
