# SPDX-License-Identifier: Apache-2.0
"""An analysis gives the same files, however many threads work at it."""

from pathlib import Path

from free_motion import free_motion, pushed

import touchline as tl
from touchline.logs import write_table
from touchline.report.analysis import CHUNK, analyze_as
from touchline.report.outputs import NAMES


def test_threads_change_no_result(tmp_path, monkeypatch):
    robot = tl.load_robot("sara")
    samples = free_motion(robot, seconds=20.0, rate=1000.0)
    assert len(samples) > 2 * CHUNK  # several parts, and an event that lasts over two
    samples = pushed(robot, samples, "link0", slice(CHUNK - 200, CHUNK + 200), [20.0, 0.0, 0.0])
    log = tmp_path / "log.parquet"
    write_table(log, samples, robot.description)
    monkeypatch.chdir(tmp_path)
    files = []
    for threads in (1, 2, 3):
        out = Path(f"with_{threads}")
        found = analyze_as(robot, "sara", log, out, threads=threads)
        assert len(found.events) == 1
        files.append({name: (out / name).read_bytes() for name in NAMES})
    for name in NAMES:
        assert files[0][name] == files[1][name] == files[2][name], name
