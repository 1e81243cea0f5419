# SPDX-License-Identifier: Apache-2.0
"""The observer benchmark's tables, with the best figures known beside ours."""

from collections.abc import Sequence

from touchline.bench.observer.discretization import DiscretizationError
from touchline.bench.observer.timing import Timing
from touchline.bench.tables import Row, aligned

# Known figures [us per sample] and where they come from.
KNOWN = {
    "Observer.run": ("0.30-0.35", "a trial kernel, C++ loop"),
    "Observer.update": ("0.74", "a trial kernel, four arrays a call, no result object"),
    "native step, no result": ("0.44-0.48", "a trial kernel, preallocated or packed input"),
    "extended observer, Pinocchio in Python": ("27-79", "Pinocchio 4.1, own trial"),
    "  its three Pinocchio calls alone": ("7.6", "Pinocchio 4.1, own trial"),
    "classical joint observer, Pinocchio in Python": ("20", "Pinocchio 4.1, own trial"),
    "wrench estimator, iDynTree, numpy in and out": ("32-60", "iDynTree 15, own trial"),
    "  its two calls alone": ("6.4-7.1", "iDynTree 15, own trial"),
}
ELSEWHERE = (
    "not run here: the paper's observer has 125 us a step (8 kHz on the robot, Iskandar et al.,\n"
    "ICRA 2021); a classical joint observer with KDL in C++ takes 10 us (own trial)."
)
# Force errors [N] at 1 and 8 kHz on another fast motion, K = 50.
KNOWN_ERRORS = {
    ("Euler", 1000.0): 0.13,
    ("rectangle", 1000.0): 0.15,
    ("exponential-trapezoid", 1000.0): 7.5e-4,
    ("Tustin", 1000.0): 1.7e-4,
    ("Euler", 8000.0): 1.6e-2,
    ("rectangle", 8000.0): 1.9e-2,
    ("exponential-trapezoid", 8000.0): 1.1e-5,
    ("Tustin", 8000.0): 3.7e-6,
}


def timing_table(timings: Sequence[Timing], run: str, update: str) -> str:
    """Time per sample of every candidate, and how it compares with our `run` and `update`."""
    medians = {timing.name: timing.median for timing in timings}
    rows: list[Row] = [
        ("us per sample", "median", "min", "x run", "x update", "known", "source of known")
    ]
    for timing in timings:
        known, source = KNOWN.get(timing.name, ("", ""))
        ratios = [f"{timing.median / medians[name]:.1f}" for name in (run, update)]
        times = [f"{timing.median:.2f}", f"{timing.minimum:.2f}"]
        rows.append((timing.name, *times, *ratios, known, source))
    return f"{aligned(rows, text_columns=(0, 6))}\n{ELSEWHERE}"


def error_table(errors: Sequence[DiscretizationError]) -> str:
    """Largest base force error of every discretization at each rate."""
    rates = sorted({error.rate for error in errors})
    found = {(error.name, error.rate): error.force for error in errors}
    head = [f"{rate / 1000:g} kHz" for rate in rates]
    rows: list[Row] = [("base force error [N]", *head, *(f"known {text}" for text in head))]
    for name in dict.fromkeys(error.name for error in errors):
        ours = [f"{found[name, rate]:.1e}" for rate in rates]
        known = [KNOWN_ERRORS.get((name, rate)) for rate in rates]
        rows.append((name, *ours, *("" if x is None else f"{x:.1e}" for x in known)))
    legend = (
        "largest over a fast motion with a push, K = 50 rad/s, against the exactly filtered push;\n"
        "known: own trial on another motion. The observer uses the last two."
    )
    return f"{aligned(rows)}\n{legend}"
