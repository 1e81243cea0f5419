# SPDX-License-Identifier: Apache-2.0
"""Runs the experiments one after the other and writes what they hand back."""

import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from touchline.errors import InputError
from touchline.folder import make_folder
from touchline.reproduce.experiment import Experiment
from touchline.reproduce.outputs import write_experiment, write_page
from touchline.suggest import did_you_mean

EXPERIMENTS = {
    "fig4": "touchline.reproduce.fig4",
    "fig5": "touchline.reproduce.fig5",
    "fig6": "touchline.reproduce.fig6",
    "applications": "touchline.reproduce.applications",
}


def reproduce(names: Sequence[str], out: Path, seed: int = 0) -> list[Experiment]:
    """Runs experiments, with a progress bar on stderr.

    Args:
        names: of the experiments; none: all.
        out: directory for a folder per experiment, and one page on all of them.
        seed: of everything random; the same seed gives the same numbers.

    Raises:
        InputError: an unknown name, or a directory that cannot be made.
        ModuleNotFoundError: matplotlib is missing.
    """
    from tqdm import tqdm

    unknown = [name for name in names if name not in EXPERIMENTS]
    if unknown:
        raise InputError(
            f"unknown experiment '{unknown[0]}'; there are: {', '.join(EXPERIMENTS)}"
            f"{did_you_mean(unknown[0], EXPERIMENTS)}"
        )
    import_module("matplotlib")  # better missed now than after the work
    make_folder(out)
    modules = [import_module(EXPERIMENTS[name]) for name in dict.fromkeys(names or EXPERIMENTS)]
    experiments = []
    steps = sum(module.STEPS + 1 for module in modules)
    with tqdm(total=steps, file=sys.stderr, unit="step", dynamic_ncols=True) as bar:
        for module in modules:
            name = module.__name__.rpartition(".")[2]

            def tick(what: str, name: str = name) -> None:
                bar.set_description(f"{name}: {what}")
                bar.update()

            drawings = import_module(f"{module.__name__}_drawing").drawings
            experiment = module.run(seed, tick, drawings)
            write_experiment(experiment, out)
            tick("written")
            experiments.append(experiment)
    write_page(experiments, out)
    return experiments


def summary_text(experiments: Sequence[Experiment], out: Path) -> str:
    """What holds and what does not, and where the results are."""
    lines = []
    for experiment in experiments:
        lines.append(experiment.title)
        lines += [
            f"  {'holds' if c.holds else 'FAILS'}  {c.name}: {c.value:.3g} (limit {c.limit:g})"
            for c in experiment.checks
        ]
    return "\n".join([*lines, f"See {out / 'index.html'}"])
