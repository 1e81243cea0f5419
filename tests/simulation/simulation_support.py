# SPDX-License-Identifier: Apache-2.0
"""Compares a simulated log with its own truth through the observer."""

import numpy as np

import touchline as tl
from touchline.simulation.truth import filter_truth

BANDWIDTH = 100.0


def estimate(robot, samples):
    """What the observer makes of samples."""
    observer = tl.Observer(robot, BANDWIDTH)
    return observer.run(samples.time, samples.q, samples.qd, samples.tau, samples.wrench)


def true_segment_wrench(robot, simulated):
    """The truth through the observer's filter (N, m, 6)."""
    by_link = {link: body.segment for body in robot.bodies for link in body.links}
    mean = simulated.truth.segment_wrench_mean(robot.segment_names, by_link)
    return filter_truth(mean, simulated.samples.time, BANDWIDTH)


def force_errors(robot, simulated):
    """Largest force error [N] of each segment against the truth."""
    error = estimate(robot, simulated.samples).segment_wrench - true_segment_wrench(
        robot, simulated
    )
    return np.linalg.norm(error[..., :3], axis=2).max(axis=0)


def strongest(simulated):
    """Largest true force [N] of each slot."""
    return np.linalg.norm(simulated.truth.force, axis=2).max(axis=0)
