# SPDX-License-Identifier: Apache-2.0
"""`touchline bench`."""

from pathlib import Path
from typing import Annotated, Literal, get_args

from tyro.conf import Positional, arg

Name = Literal["observer", "localization", "classification", "reaction", "wrench", "detection"]
NAMES: tuple[Name, ...] = get_args(Name)


def bench(
    names: Annotated[Positional[tuple[Name, ...]], arg(metavar="[NAME ...]")] = (),
    /,
    output: Annotated[Path | None, arg(metavar="FILE")] = None,
    rounds: int = 40,
    robots: tuple[Literal["panda", "sara", "sara-full", "ur10"], ...] = ("panda",),
    contacts: tuple[Literal[1, 2, 3], ...] = (1, 2, 3),
    noise: tuple[Literal[0, 1, 2, 3], ...] = (0, 1, 2, 3),
    begin: tuple[Literal["apart", "together"], ...] = ("apart", "together"),
    speeds: tuple[float, ...] = (0.0,),
    runs: int = 1000,
    seed: int = 0,
    interactions: int = 2000,
    encounters: int = 2,
    guiding: float = 1.0,
    hours: float = 0.5,
    pushes: int = 100,
    out: Annotated[Path | None, arg(metavar="DIR")] = None,
    baselines: tuple[Literal["first", "nearest", "particles"], ...] = (
        "first",
        "nearest",
        "particles",
    ),
) -> int:
    """Measures speed and accuracy beside the peers that are installed.

    Example: touchline bench localization --robots panda sara --runs 10000 --out figures

    Args:
        names: What to measure (observer, localization, classification, reaction, wrench,
            detection); default: everything.
        output: observer: writes the figures here as well (.json or .csv).
        rounds: observer: how often each candidate is timed.
        robots: localization: the arms; panda and ur10 need the package example-robot-data.
        contacts: localization: how many contacts at once, at most one per rigid body.
        noise: localization: tiers of sensor noise, 0 is none.
        begin: localization: several contacts begin 0.1 s apart, or at the same instant.
        speeds: localization: of every joint [rad/s]; 0 is an arm at rest.
        runs: localization: random poses and places per line of the tables.
        seed: localization, classification, wrench: of all that is random.
        interactions: classification: how many are simulated.
        encounters: reaction: collisions for each link and speed.
        guiding: reaction: hours in which the arm is led by its handle.
        hours: detection: simulated at 1 kHz for calibration, and as many for false alarms.
        pushes: detection: of each force.
        out: localization, classification, reaction, wrench, detection: folder for tables, runs
            and figures.
        baselines: localization: what runs along: the first entry of the line of force action, the
            surface nearest to the line, a contact particle filter (on 100 runs a line).
    """
    wanted = names or NAMES
    if "observer" in wanted:
        from touchline.bench.observer import main as measure_observer

        measure_observer(output, rounds)
    if "localization" in wanted:
        from touchline.bench.localization import Plan
        from touchline.bench.localization import main as measure_localization

        plan = Plan(robots, contacts, noise, begin, speeds, runs, seed, baselines)
        measure_localization(plan, out)
    if "classification" in wanted:
        from touchline.bench.classification import main as measure_classification

        measure_classification(interactions, seed, out)
    if "reaction" in wanted:
        from touchline.bench.reaction import main as measure_reaction

        measure_reaction(encounters, guiding, out)
    if "wrench" in wanted:
        from touchline.bench.wrench import main as measure_wrench

        measure_wrench(out, seed)
    if "detection" in wanted:
        from touchline.bench.detection import main as measure_detection

        measure_detection(hours, pushes, out)
    return 0
