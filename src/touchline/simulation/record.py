# SPDX-License-Identifier: Apache-2.0
"""A scenario by its name to a log file with truth."""

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from touchline.errors import InputError
from touchline.folder import check_file
from touchline.model.robot import Robot
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import SCENARIOS
from touchline.simulation.scene import Run
from touchline.simulation.truth import Simulated
from touchline.suggest import did_you_mean

Write = Callable[..., None]  # as `touchline.logs.tables.write_table`


OPTIONS = ("seconds", "speed", "force")  # that a scenario may have; further ones are Python's


def scenario_options(scenario: str) -> dict[str, float]:
    """The options of a scenario with their defaults [s, rad/s, N]."""
    parameters = inspect.signature(find_scenario(scenario)).parameters
    return {name: p.default for name, p in parameters.items() if name in OPTIONS}


def simulate_to_log(
    scenario: str,
    robot: Robot,
    out: Path | str,
    write: Write,
    settings: Run | None = None,
    options: Mapping[str, Any] | None = None,
) -> Simulated:
    """Runs a scenario and writes its log.

    Args:
        scenario: a name in `SCENARIOS`.
        robot: any.
        out: `.parquet`, `.csv` or `.csv.gz`.
        write: writes the table; called as `write(path, samples, description, metadata, extra)`.
        settings: rates, seed, noise; default: those of `Run`, with the default noise.
        options: further arguments of the scenario, such as `seconds` and `speed`.

    Raises:
        InputError: there is no such scenario, it has no such option, or the log cannot be written.
    """
    run = find_scenario(scenario)
    options = dict(options or {})
    known = list(scenario_options(scenario))
    unknown = [name for name in options if name not in known]
    if unknown:
        raise InputError(
            f"scenario {scenario} has no option --{name}{did_you_mean(name, known)}; it has: "
            + (", ".join(f"--{option}" for option in known) or "none")
            for name in unknown
        )
    _prepare(Path(out))
    simulated = run(robot, settings=settings or Run(noise=SensorNoise()), **options)
    keeps = Path(out).suffix == ".parquet"
    metadata = simulated.metadata | {"truth.links": list(simulated.truth.links)}
    columns = simulated.truth.columns()
    write(out, simulated.samples, robot.description, metadata if keeps else None, columns)
    return simulated


def find_scenario(name: str) -> Callable[..., Simulated]:
    """The scenario of a name.

    Raises:
        InputError: there is none.
    """
    if name not in SCENARIOS:
        raise InputError(
            f"no scenario is called '{name}'{did_you_mean(name, SCENARIOS)}; "
            f"there are: {', '.join(SCENARIOS)}"
        )
    return SCENARIOS[name]


def _prepare(out: Path) -> None:
    """Find what is in the way before the work begins, so that nothing simulated is lost."""
    if not out.name.endswith((".parquet", ".csv", ".csv.gz")):
        raise InputError(f"{out}: a table's name ends in .parquet, .csv or .csv.gz")
    if out.suffix == ".parquet":
        import pyarrow.parquet  # noqa: F401
    check_file(out)
