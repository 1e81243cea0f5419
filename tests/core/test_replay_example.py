# SPDX-License-Identifier: Apache-2.0
"""A C++ program replays a log on an exported robot and says what Python says, to the last bit."""

from pathlib import Path

import numpy as np
import pytest
from program import COMPILER, PLAIN, SANITIZED, THREADED, compile_program, run_program

import touchline as tl
from touchline.identify.rest import with_rest
from touchline.model.learned_rest import LearnedRest
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import Run, three_touches

ROOT = Path(__file__).parents[2]
REST = LearnedRest(
    (-9.0, 1.0, 9.0), (-9.0, 0.0, 9.0), (0.0,) * 4 + (0.02,) + (0.0,) * 4, (0.0,) * 9
)

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C++ compiler on this machine")


@pytest.fixture(scope="module")
def replayed(tmp_path_factory):
    """Folder with an exported robot and a log with faults; the robot; samples."""
    folder = tmp_path_factory.mktemp("replay")
    robot = with_rest(tl.load_robot("sara"), {"joint4": REST})
    s = three_touches(robot, speed=1.0, seconds=0.6, settings=Run(noise=SensorNoise())).samples
    s.tau[300, 2] = np.nan
    s.wrench[320:330, 0] = np.inf
    s.q[340, 1] = np.nan
    s.time[400:] += 0.1
    s.time[450] = s.time[449]
    s.wrench[520:, 1] = np.nan  # lost for good, while it feels a touch: a stand-in speaks
    tl.Pipeline(robot).export(folder / "sara.touchline")
    names = ",".join(f"c{i}" for i in range(1 + 3 * 7 + 6 * len(robot.sensor_names)))
    columns = np.column_stack([s.time, s.q, s.qd, s.tau, s.wrench.reshape(len(s), -1)])
    lines = [",".join(repr(x) for x in row) for row in columns.tolist()]
    (folder / "log.csv").write_text("\n".join([names, *lines]) + "\n")
    return folder, robot, s


builds = pytest.mark.parametrize("flags", [PLAIN, SANITIZED], ids=["plain", "sanitized"])


@builds
def test_a_program_says_the_same_to_the_last_bit(replayed, run_whole, flags):
    folder, robot, s = replayed
    pipeline = tl.Pipeline(robot)
    said = run_whole("replay", flags, folder / "sara.touchline", folder / "log.csv")
    lines = [line.split() for line in said]
    contacts = np.array([line[1:] for line in lines if line[0] == "contact"], dtype=float)
    events = np.array([line[2:] for line in lines if line[0] == "event"], dtype=float)
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    table = pipeline.contacts
    assert len(table) > 500
    assert pipeline.lost == [robot.sensor_names[1]]
    assert s.time[table.sample[-1]] > s.time[520] + 0.02
    np.testing.assert_array_equal(contacts[:, 0], s.time[table.sample])
    np.testing.assert_array_equal(contacts[:, 1:], table.numbers)
    theirs = [tl.Event.of(row, table.names) for row in events]
    assert len(theirs) >= 3
    assert sorted(theirs, key=lambda event: event.id) == pipeline.events


@builds
def test_no_allocation_per_sample_and_the_same_bits_in_any_parts(replayed, run_whole, flags):
    folder, _, _ = replayed
    given = (folder / "sara.touchline", folder / "log.csv")
    lines = [
        line.split() for line in run_whole("pipeline_no_allocation", flags, *given, counting=True)
    ]
    assert len(lines) == 4
    for allocations, contacts, ended, _ in lines:
        assert allocations == "0"
        assert int(contacts) > 500 and int(ended) >= 1
    assert len({checksum for *_, checksum in lines}) == 1


def test_one_pipeline_per_thread_is_enough(replayed):
    folder, _, _ = replayed
    source = Path(__file__).parent / "pipeline_threads.cpp"
    complaint = compile_program(source, folder / "threads", *THREADED)
    if "ltsan" in complaint:
        pytest.skip("the compiler has no thread sanitizer")
    assert complaint == ""
    lines = run_program(folder / "threads", folder / "sara.touchline").stdout.split()
    assert len(lines) == 4 and len(set(lines)) == 1 and float(lines[0]) > 100.0


def test_the_example_is_short():
    assert len((ROOT / "core" / "example" / "replay.cpp").read_text().splitlines()) <= 60
