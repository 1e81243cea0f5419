# SPDX-License-Identifier: Apache-2.0
"""The recordings, each with the shortest description of its robot: model, locked joints, names.

No friction, no noise figures, no thresholds: what a new robot starts with.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.logs import open_log
from touchline.model.robot import Robot, load_robot
from touchline.observer.samples import Samples

PANDA = "name: panda\nmodel: package://example-robot-data/robots/panda_description/urdf/panda.urdf"
PANDA_HAND = f"""\
{PANDA}
locked: {{panda_finger_joint1: 0.0}}
log: {{q: "q{{i}}", qd: "dq{{i}}", tau: "tau_J{{i}}"}}
"""
PANDA_NO_HAND = f"""\
{PANDA}
locked: {{panda_finger_joint1: 0.0}}
links: {{panda_hand: {{mass: 0.0}}, panda_leftfinger: {{mass: 0.0}},
  panda_rightfinger: {{mass: 0.0}}}}
log:
  joint_names: {{panda_joint1: fer_joint1, panda_joint2: fer_joint2, panda_joint3: fer_joint3,
    panda_joint4: fer_joint4, panda_joint5: fer_joint5, panda_joint6: fer_joint6,
    panda_joint7: fer_joint7}}
"""
UR10 = """\
name: ur10
model: package://example-robot-data/robots/ur_description/urdf/ur10_robot.urdf
"""
KUKA = "name: kuka-lwr4\nmodel: {data}/kuka_lwr4/kuka_lwr4.urdf\npackage_dirs: [{data}]\n"
KINOVA = """\
name: kinova-gen3
model: {data}/kinova_gen3/kinovaGen3V12.urdf
log:
  time: {{column: Time, factor: 0.001}}
  q: "Position{{i1}}"
  qd: "Velocity{{i1}}"
  tau: "TorqueSm{{i1}}"
"""
LINKS = {"a": 7, "b": 6, "c": 5, "d": 4, "f": 2}  # touched, by the first letter of a file's name
FREE = (
    ("UR10, motor currents", "panda_ur10_rosbag2/ur10_exciting_trajectory.db3", UR10),
    ("Panda", "panda_ur10_rosbag2/panda_exciting_trajectory.db3", PANDA_NO_HAND),
    ("KUKA LWR4+, first", "kuka_lwr4/free_motion_1.csv.gz", KUKA),
    ("KUKA LWR4+, second", "kuka_lwr4/free_motion_2.csv.gz", KUKA),
    ("Kinova Gen3, tool, first", "kinova_gen3/opti_traj_testing1.csv", KINOVA),
    ("Kinova Gen3, tool, second", "kinova_gen3/opti_traj_testing2.csv", KINOVA),
)


@dataclass(frozen=True)
class Recording:
    """A recording with its robot.

    Attributes:
        name: of the recording.
        robot: described by no more than its model.
        samples: all of them.
        period: median time between samples [s].
        touches: (T, 2) begin and end of each touch [s].
        link: number of the touched link; 0 where nothing touches.
    """

    name: str
    robot: Robot
    samples: Samples
    period: float
    touches: Array
    link: int = 0


def touched_files(data: Path) -> list[Path]:
    """The files with touches of a Panda below `data`."""
    return sorted(data.glob("panda_touches/*.csv.gz")) + sorted(
        data.glob("panda_touches_more/*.csv.gz")
    )


def read_touched(path: Path, scratch: Path) -> Recording:
    """A Panda that is touched by hand: which link is in the file's name."""
    robot = _robot(PANDA_HAND, path, scratch)
    samples = _from_second(_read(path, robot))  # the first may be odd
    label = np.genfromtxt(path, delimiter=",", names=True)
    touched = np.concatenate([[0], np.asarray(label["label"] > 0.5, int), [0]])
    edges = np.diff(touched)
    time = np.asarray(label["time"], float)
    touches = np.column_stack([time[edges[:-1] == 1], time[np.flatnonzero(edges == -1) - 1]])
    return Recording(
        path.name.split(".")[0], robot, samples, _period(samples), touches, LINKS[path.name[0]]
    )


def read_free(data: Path, scratch: Path) -> list[Recording]:
    """Motion in which nothing touches, as far as the recordings are there."""
    found = []
    for name, file, text in FREE:
        path = data / file
        if path.exists():
            robot = _robot(text.format(data=data) if "{data}" in text else text, path, scratch)
            samples = _read(path, robot)
            found.append(Recording(name, robot, samples, _period(samples), np.zeros((0, 2))))
    return found


def at_rate(recording: Recording, rate: float, later: float = 0.0) -> Recording:
    """As if it had been recorded at a lower rate [Hz]: the first sample from each instant on.

    Args:
        recording: at its own rate.
        rate: the lower one [Hz].
        later: part of a period by which the first instant is later than the first sample.
    """
    s = recording.samples
    instants = np.arange(s.time[0] + later / rate, s.time[-1], 1.0 / rate)
    kept = np.zeros(len(s), bool)
    kept[np.searchsorted(s.time, instants)] = True
    return replace(recording, samples=s.where(kept), period=1.0 / rate)


def _robot(text: str, path: Path, scratch: Path) -> Robot:
    file = scratch / f"{path.name}.yaml"
    file.write_text(text)
    return load_robot(file)


def _read(path: Path, robot: Robot) -> Samples:
    with open_log(path, robot.description) as log:
        parts = list(log.chunks())
    if not parts:
        raise InputError(f"{path}: holds no samples")
    time, q, qd, tau, wrench = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("time", "q", "qd", "tau", "wrench")
    )
    return Samples(time, q, qd, tau, wrench)


def _from_second(s: Samples) -> Samples:
    return Samples(s.time[1:], s.q[1:], s.qd[1:], s.tau[1:], s.wrench[1:])


def _period(samples: Samples) -> float:
    return float(np.median(np.diff(samples.time)))
