# SPDX-License-Identifier: Apache-2.0
"""Straight lines through data in which some points are touched, and factors that have names."""

from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array

UNREAL = 1e12  # in any unit: no reading of a sensor
TUKEY = 4.7  # standard deviations beyond which a point does not count (95 % efficiency)
LOST = 1e-4  # of a coefficient's square that no point tells; rounding mixes in less
SINGULAR = 1e-12  # of unit columns: rounding makes a combination no weaker
NEAR = 0.12  # a factor within this fraction of a named one is that one

FORCE_FACTORS = {
    9.80665: "N where kgf is expected, or a factor of 9.81 applied twice",
    1 / 9.80665: "kgf: use factor 9.80665",
    1000.0: "mN: use factor 0.001",
    1000 / 9.80665: "grams: use factor 0.00980665",
    0.001: "kN: use factor 1000",
    4.44822: "a factor of 4.448 (pounds) applied twice",
    1 / 4.44822: "pounds: use factor 4.44822",
}
MOMENT_FACTORS = {
    9.80665: "a factor of 9.81 applied twice",
    1 / 9.80665: "kgf m: use factor 9.80665",
    1000.0: "mNm: use factor 0.001",
    0.001: "kNm: use factor 1000",
    100.0: "Ncm: use factor 0.01 (0.00980665 where forces are in grams)",
    1 / 1.35582: "pound-feet: use factor 1.35582",
    1 / 0.112985: "pound-inches: use factor 0.112985",
}
ANGLE_FACTORS = {
    180 / np.pi: "degrees: use factor 0.01745329",
    np.pi / 180: "degrees converted twice",
    30 / np.pi: "revolutions per minute: use factor 0.10471976",
    1000.0: "a thousandth of rad/s: use factor 0.001",
    0.001: "thousands of rad/s: use factor 1000",
}


@dataclass(frozen=True)
class Line:
    """y = X @ coefficients, with their standard errors and the scatter (1 sigma) of the points.

    An error is infinite where the points do not tell a coefficient.
    """

    coefficients: Array
    errors: Array
    scatter: float


def scatter_of(values: Array) -> float:
    """Standard deviation of most of the values (from the median of their magnitudes)."""
    return float(1.4826 * np.median(np.abs(values))) if len(values) else np.nan


def robust_line(X: Array, y: Array, rounds: int = 30) -> Line | None:
    """Least squares in which far points lose their weight (Tukey's biweight).

    Args:
        X: (W, c) regressors.
        y: (W,).
        rounds: of reweighting.

    Returns:
        None where there are too few points.
    """
    use = (np.abs(y) < UNREAL) & (np.abs(X) < UNREAL).all(axis=1)
    X, y = X[use], y[use]
    if len(y) < max(3, 2 * X.shape[1]):
        return None
    weight = np.ones(len(y))
    beta, spread = np.zeros(X.shape[1]), 0.0
    for turn in range(rounds):
        root = np.sqrt(weight)[:, None]
        beta = np.asarray(np.linalg.lstsq(X * root, y * root[:, 0], rcond=None)[0], dtype=float)
        rest = y - X @ beta
        spread = max(scatter_of(rest), 1e-9 * (1.0 + float(np.abs(y).max())))
        if turn < 5:  # first the kinder weights of Huber, which do not fix on a wrong line
            weight = np.minimum(1.0, 1.5 * spread / np.maximum(np.abs(rest), 1e-300))
        else:
            weight = np.clip(1 - (rest / (TUKEY * spread)) ** 2, 0, None) ** 2
    return Line(beta, spread * unit_errors((X * weight[:, None]).T @ X), spread)


def unit_errors(normal: Array) -> Array:
    """Standard errors (c,) for unit scatter; infinite where the points tell no coefficient."""
    size = np.sqrt(np.diag(normal))
    some = np.flatnonzero(size > 0.0)
    errors = np.full(len(size), np.inf)
    # Columns have units of their own: a small one is no lost one.
    powers, vectors = np.linalg.eigh(normal[np.ix_(some, some)] / np.outer(size[some], size[some]))
    kept = powers > SINGULAR
    lost = (vectors[:, ~kept] ** 2).sum(axis=1) > LOST
    variance = (vectors[:, kept] ** 2 / powers[kept]).sum(axis=1)
    errors[some] = np.where(lost, np.inf, np.sqrt(variance) / size[some])
    return errors


def named_factor(value: float, factors: dict[float, str]) -> str | None:
    """What a factor is known for, None if it is none of them."""
    found = factor_words(value, factors)
    return None if found is None else found[1]


def factor_words(
    value: float, factors: dict[float, str], near: float = NEAR
) -> tuple[float, str] | None:
    """The known factor that a value is near, relative, and what it is known for."""
    known = min(factors, key=lambda factor: abs(np.log(max(abs(value), 1e-300) / factor)))
    return (known, factors[known]) if abs(abs(value) / known - 1) < near else None
