# SPDX-License-Identifier: Apache-2.0
"""Recordings of running robots, replayed: are the numbers those of live, to the last bit?

python benchmarks/live_replay.py [COUNT [PYTHON [SOURCE ...]]]

Makes COUNT recordings (default 5) of each source, MCAP and Parquet in turn, and compares each
sample's estimate, contacts and events with those of their replay. ros2:// needs touchline[ros2];
franka:// needs PYTHON, the interpreter of an environment with franky-sim, as live_franka.py.
"""

import contextlib
import importlib.util
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from live_faults import TESTS

SUFFIXES = (".parquet", ".mcap")


def of_simulation(folder: Path, number: int):
    """The simulated arm, another at each number."""
    from touchline.model.robot import load_robot

    return load_robot("sara"), f"sim://?speed=0&seed={number + 1}", contextlib.nullcontext()


def of_recording(folder: Path, number: int):
    """A recording that is replayed and recorded anew."""
    from live_support import watch

    robot, source, _ = of_simulation(folder, number + 10)
    path = folder / "first.mcap"
    watch(robot, source, path, duration=4.0)
    return robot, f"replay://{path}?speed=0", contextlib.nullcontext()


def of_ur(folder: Path, number: int):
    """An arm that speaks RTDE and is pushed."""
    from fake_rtde import FakeController
    from live_arms import make_arm, pushed

    arm = make_arm(folder, 6)
    controller = FakeController(pushed(arm, seconds=60.0, begin=1.6 + 0.2 * number))
    return arm, controller.address, controller


def of_ros(folder: Path, number: int):
    """An arm's topics, published by a process of its own."""
    from live_arms import write_arm

    from touchline.model.robot import load_robot

    path = write_arm(folder, 6)
    paths = [str(TESTS), str(TESTS.parent), os.environ.get("PYTHONPATH", "")]
    env = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, str(TESTS / "ros_publisher.py"), str(path), "60", "push"]
    return load_robot(path), "ros2://", running(command, env=env)


def of_franka(folder: Path, number: int):
    """An arm that speaks Franka's protocol and is pushed."""
    from live_franka import HOST, PARTNER

    from touchline.model.robot import load_robot

    command = [sys.argv[2], str(PARTNER), str(folder), str(number), "1"]
    kept = contextlib.ExitStack()
    kept.enter_context(running(command))
    return load_robot(folder / "robot.yaml"), f"franka://{HOST}", kept


@contextlib.contextmanager
def running(command: list[str], **settings):
    """A process that has said it is ready, until it is not needed."""
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, **settings) as process:
        assert process.stdout is not None
        process.stdout.readline()
        try:
            yield
        finally:
            process.kill()


def main() -> None:
    """Prints a line for each source."""
    sys.path[:0] = [str(TESTS.parent)]
    from live_support import assert_same, watch

    count = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    sources = {"sim://": of_simulation, "replay://": of_recording, "ur://": of_ur}
    if importlib.util.find_spec("rclpy") is not None:
        sources["ros2://"] = of_ros
    if len(sys.argv) > 2:
        sources["franka://"] = of_franka
    chosen = sys.argv[3:] or list(sources)
    for name, make in ((name, sources[name]) for name in chosen):
        samples = events = same = 0
        for number in range(count):
            with tempfile.TemporaryDirectory() as made:
                folder = Path(made)
                robot, source, peer = make(folder, number)
                path = folder / f"run{SUFFIXES[number % 2]}"
                with peer:
                    seconds = None if name == "replay://" else 10.0 if "franka" in name else 4.5
                    live = watch(robot, source, path, duration=seconds)
                again = watch(robot, f"replay://{path}?speed=0", duration=None)
                for seen in (live, again):  # native threads had gone on behind the last sample
                    end = seen.times[-1]
                    seen.events = [e for e in seen.events if e["cleared"] and e["cleared"] <= end]
                samples, events = samples + len(live.times), events + len(live.events)
                try:
                    assert_same(again, live)
                    same += 1
                except AssertionError:
                    print(f"  {name} {number}: not the same")
        print(
            f"{name:10} {count} recordings, {samples} samples, {events} events: "
            f"{same} the same to the last bit",
            flush=True,
        )


if __name__ == "__main__":
    main()
