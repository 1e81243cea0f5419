# SPDX-License-Identifier: Apache-2.0
"""Installs a wheel where no compiler is, and takes eight robots from their models to results.

    python scripts/acceptance.py WHEEL [--data DIR]

Makes a virtual environment of this Python in a temporary folder, installs the wheel with its extras
and the model collections, and runs `touchline` with an empty PATH: `demo`, then `init`, `analyze`
for each robot. Nothing is written by hand. A robot whose model is not on this machine is told and
left out; the names that end in `_mj` come from the cache of robot_descriptions (MuJoCo Menagerie),
other paths are below DIR: the recordings that docs/contributing.md names, and a clone of
franka_description. Ends with status 1 if a step fails.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

COLLECTIONS = ("example-robot-data", "robot_descriptions", "xacro")
LIMIT = 600  # s for one command
SECONDS = 4  # of a simulated recording
ABSENT = ("no such file", "is not there; fetch it once", "no robot of this name")


@dataclass(frozen=True)
class Case:
    """A robot: what it is, the names that its model has, and its recording if there is one."""

    title: str
    models: tuple[str, ...]
    recording: str | None = None


CASES = (
    Case("xArm7", ("xarm7_mj", "xarm7")),
    Case("FR3", ("fr3_mj", "franka_description/robots/fr3/fr3.urdf.xacro")),
    Case("iiwa14", ("iiwa14_mj",)),
    Case("UR5e MJCF", ("ur5e_mj",)),
    Case("UR10, currents", ("ur10_robot",), "panda_ur10_rosbag2/ur10_exciting_trajectory.db3"),
    Case("Kinova Gen3", ("kinova_gen3/kinovaGen3V12.urdf",), "kinova_gen3/opti_traj_testing1.csv"),
    Case("dual arm (Baxter)", ("baxter",)),
    Case("humanoid's legs (G1)", ("g1_mj", "g1_29dof_rev_1_0")),
)


class Machine:
    """A fresh environment in which no program but Touchline's is found."""

    def __init__(self, folder: Path, wheel: Path) -> None:
        self.folder, bare = folder, folder / "bare"
        bare.mkdir()
        kept = ("HOME", "ROBOT_DESCRIPTIONS_CACHE", "OMP_NUM_THREADS")
        self._environment = {name: os.environ[name] for name in kept if name in os.environ}
        self._environment["PATH"] = str(bare)
        subprocess.run([sys.executable, "-m", "venv", str(folder / "venv")], check=True)
        self._bin = folder / "venv" / ("Scripts" if os.name == "nt" else "bin")
        pip = [str(self._bin / "python"), "-m", "pip", "install", "--quiet"]
        subprocess.run([*pip, f"{wheel.resolve()}[all]", *COLLECTIONS], check=True)

    def touchline(self, *arguments: str) -> tuple[int, str, float]:
        """Run a command; returns its status, what it said, and how long it took [s]."""
        began = time.monotonic()
        command = [str(self._bin / "touchline"), *arguments]
        done = subprocess.run(
            command,
            cwd=self.folder,
            env=self._environment,
            capture_output=True,
            text=True,
            timeout=LIMIT,
            check=False,
        )
        return done.returncode, done.stdout + done.stderr, time.monotonic() - began


def take(machine: Machine, case: Case, data: Path) -> str | None:
    """Return the table's row of a robot, None if its model or recording is not here.

    Raises:
        RuntimeError: a step failed.
    """
    name = re.sub(r"\W+", "_", case.title.lower())
    description, out = f"{name}.yaml", f"{name}.results"
    recording = None if case.recording is None else data / case.recording
    if recording is not None and not recording.exists():
        return None
    for model in case.models:
        source = str(data / model) if (data / model).exists() else model
        made = recording or machine.folder / f"{name}.parquet"
        if recording is None:
            options = ("--out", str(made), "--seconds", str(SECONDS))
            status, said, _ = machine.touchline(
                "simulate", "free_motion", "--robot", source, *options
            )
            if status and any(absent in said for absent in ABSENT):
                continue
            check(status, f"{case.title}: simulate", said)
        status, said, first = machine.touchline("init", source, str(made), "--out", description)
        if status and any(absent in said for absent in ABSENT):
            continue
        check(status, f"{case.title}: init", said)
        torque = re.search(r"`torque: (\w+)`", said)
        status, said, second = machine.touchline(
            "analyze", str(made), "--robot", description, "--out", out
        )
        check(status, f"{case.title}: analyze", said)
        made_of = "simulated" if recording is None else "recorded"
        events = re.search(r"^events: (\w+)", said, re.MULTILINE)
        assert torque and events and (machine.folder / out / "report.html").stat().st_size
        return (
            f"| {case.title} | `{model}` | {made_of} | {torque[1]} | {first:.1f} | {second:.1f} | "
            f"{events[1]} |"
        )
    return None


def check(status: int, step: str, said: str) -> None:
    """Make sure that a command ended well.

    Raises:
        RuntimeError: it did not.
    """
    if status:
        raise RuntimeError(f"{step}: status {status}\n{said}")


def main() -> int:
    """Run all; returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("TOUCHLINE_DATA", ".")))
    given = parser.parse_args()
    failed, absent = 0, []
    with tempfile.TemporaryDirectory() as folder:
        machine = Machine(Path(folder), given.wheel)
        status, said, took = machine.touchline("demo", "--headless", "--out", "demo")
        check(status, "demo", said)
        print(f"demo --headless: {took:.0f} s\n")
        print("| robot | model | log | torque | init [s] | analyze [s] | events |")
        print("|---|---|---|---|---|---|---|", flush=True)
        for case in CASES:
            try:
                row = take(machine, case, given.data)
            except RuntimeError as error:
                failed += 1
                print(error, file=sys.stderr, flush=True)
                continue
            if row is None:
                absent.append(case.title)
            else:
                print(row, flush=True)
    if absent:
        print(f"\nleft out, not on this machine: {', '.join(absent)}")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
