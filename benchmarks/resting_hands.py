# SPDX-License-Identifier: Apache-2.0
"""Which hands that rest on an arm throughout a recording `calibrate` refuses, and what else.

python benchmarks/resting_hands.py [FOLDER] takes simulated arms that are not as described and, with
the folder of real recordings, these. Each is judged as it is, with a hand of 12 N on a late link,
and with a table's 12 N upward at the last link. It prints the force found and what that explains.
"""

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from touchline.calibrate.afterwards import refuse_resting, refuse_touched, refuse_unexplained
from touchline.calibrate.resting import find_resting
from touchline.errors import InputError
from touchline.identify.evidence import gather
from touchline.identify.identification import identify
from touchline.model.robot import Robot
from touchline.observer.dynamics import contact_loads
from touchline.observer.samples import Samples
from touchline.trials.arms import described_arm
from touchline.trials.free_motion import random_trajectory
from touchline.trials.real_recordings import read_free
from touchline.trials.wrong_arm import make_wrong_arm, record

SIMULATED = (
    ("panda-torques", "friction", 1),
    ("panda-torques", "payload alone", 2),
    ("sara", "payload alone", 3),
    ("ur10", "friction", 4),
    ("sara-full", "bias", 5),
)
SECONDS, RATE, HAND = 60.0, 100.0, 12.0  # s, Hz, N


def main(folder: str = "") -> None:
    """Prints a line for each recording, then how many of each kind are refused."""
    counts: dict[str, list[int]] = {}
    for kind, name, robot, samples in _cases(folder):
        told, refused = _judged(robot, samples)
        print(f"{kind:12}  {name:45}  {told}", flush=True)
        if refused is not None:
            counts.setdefault(kind, []).append(refused)
    for kind, refused in counts.items():
        print(f"{kind}: {sum(refused)} of {len(refused)} refused that older rules let through")


def _judged(robot: Robot, samples: Samples) -> tuple[str, int | None]:
    try:
        found = identify(gather(robot, [[samples]]))
        refuse_unexplained(found, [])
        refuse_touched(found, [])
    except InputError as error:
        return f"refused before: {str(error)[:60]}", None
    force = find_resting(found)
    if force is None:
        return "no force", 0
    try:
        refuse_resting(found, [])
        told = "accepted"
    except InputError:
        told = "refused"
    return (
        f"{force.size:5.1f} N at {force.link:24} {force.explained:5.0%} {told}",
        told == "refused",
    )


def _cases(folder: str) -> Iterator[tuple[str, str, Robot, Samples]]:
    for name, kind, seed in SIMULATED:
        robot, rng = described_arm(name), np.random.default_rng(seed)
        arm = make_wrong_arm(robot, kind, rng)
        yield from _touched("", name, robot, _recorded(arm, robot, rng), rng)
    if folder:
        with tempfile.TemporaryDirectory() as scratch:
            for number, one in enumerate(read_free(Path(folder).resolve(), Path(scratch))):
                rng = np.random.default_rng(number)
                yield from _touched("real ", one.name, one.robot, one.samples, rng)


def _recorded(arm, robot: Robot, rng: np.random.Generator) -> Samples:
    return record(arm, random_trajectory(robot, rng), SECONDS, RATE, rng)


def _touched(
    prefix: str, name: str, robot: Robot, free: Samples, rng: np.random.Generator
) -> Iterator[tuple[str, str, Robot, Samples]]:
    yield f"{prefix}free", name, robot, free
    links = [node.links[0] for node in robot.nodes if node.links]
    for link in links[-3:]:
        way = rng.normal(size=3)
        hand = HAND * way / np.linalg.norm(way)
        yield f"{prefix}hand", f"{name}, {link}", robot, _pushed(robot, free, link, hand)
    table = np.array([0.0, 0.0, HAND])
    yield f"{prefix}table", f"{name}, {links[-1]}", robot, _pushed(robot, free, links[-1], table)


def _pushed(robot: Robot, s: Samples, link: str, force: np.ndarray) -> Samples:
    """With a force [N] in world at a link's origin all through the recording."""
    places = np.array([robot.T_world_links(q)[link][:3, 3] for q in s.q])
    forces = np.tile(force, (len(s.q), 1))
    loads = contact_loads(robot, s.q, link, np.hstack([forces, np.cross(places, forces)]))
    return replace(s, tau=s.tau - loads.torque, wrench=s.wrench - loads.wrench)


if __name__ == "__main__":
    with threadpool_limits(1, "blas"):
        main(*sys.argv[1:])
