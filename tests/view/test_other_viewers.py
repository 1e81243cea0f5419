# SPDX-License-Identifier: Apache-2.0
"""Files for Rerun and Foxglove, read by their own readers; told at once where these are missing."""

import json
import sys
from collections import Counter

import numpy as np
import pytest

from touchline.cli import main
from touchline.errors import InputError
from touchline.logs.mcap import is_for_viewers
from touchline.view.moments import arrow, curves, moments, told
from touchline.view.replay import Replay


@pytest.fixture(scope="module")
def replay(touched):
    return Replay(touched.out)


def test_moments_are_the_arm_thirty_times_a_second(replay, touched):
    found = list(moments(replay))
    times = np.array([moment.time for moment in found])
    assert np.diff(times).min() > 0.02 and len(times) == pytest.approx(30 * np.ptp(times), abs=2)
    pressed = [moment for moment in found if moment.contacts]
    assert pressed and len(pressed) < len(found)
    for moment in found[::10]:
        row = np.searchsorted(touched.samples.time, moment.time)
        wanted = replay.robot.T_world_links(touched.samples.q[row])
        for link, pose in moment.poses.items():
            np.testing.assert_allclose(pose, wanted[link], atol=1e-9)


def test_curves_are_samples_of_the_estimates(replay):
    times = np.concatenate([part for part, _ in curves(replay)])
    values = np.concatenate([part["tau_ext.joint2"] for _, part in curves(replay)])
    every = np.concatenate(
        [replay.estimates.values("time", g) for g in range(replay.estimates.groups)]
    )
    torque = np.concatenate(
        [replay.estimates.values("tau_ext.joint2", g) for g in range(replay.estimates.groups)]
    )
    np.testing.assert_array_equal(values, torque[np.searchsorted(every, times)])
    assert len(times) == pytest.approx(100 * np.ptp(every), abs=2)


def test_foxglove_opens_it(replay, tmp_path):
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    reader = pytest.importorskip("mcap.reader", reason="mcap is not installed")
    from touchline.view.foxglove_file import write_foxglove

    path = tmp_path / "results.mcap"
    write_foxglove(replay, path)
    assert [p.name for p in tmp_path.iterdir()] == ["results.mcap"] and is_for_viewers(path)
    counts, events, wrenches = Counter(), [], []
    with path.open("rb") as file:
        for schema, channel, message in reader.make_reader(file).iter_messages():
            counts[channel.topic, schema.name] += 1
            if channel.topic == "/events":
                events.append(json.loads(message.data))
            if channel.topic == "/wrench/wrist.seg":
                wrenches.append(json.loads(message.data))
            assert replay.start - 1e-6 <= 1e-9 * message.log_time <= replay.end + 1e-6
    frames = len(list(moments(replay)))
    assert counts["/tf", "foxglove.FrameTransforms"] == frames
    assert counts["/robot", "foxglove.SceneUpdate"] == 1
    pressed = sum(bool(moment.contacts) for moment in moments(replay))
    assert pressed <= counts["/contacts", "foxglove.SceneUpdate"] <= frames
    assert counts["/tau_ext", "foxglove.JointStates"] == sum(len(t) for t, _ in curves(replay))
    assert [event["id"] for event in events] == [facts["id"] for *_, facts in told(replay.events)]
    column = np.concatenate([values["wrist.seg.fz"] for _, values in curves(replay)])
    seen = [wrench["force"]["z"] for wrench in wrenches]
    np.testing.assert_array_equal(seen, column[np.isfinite(column)])


def test_rerun_opens_it(replay, tmp_path):
    reader = pytest.importorskip("rerun.chunk", reason="rerun-sdk is not installed")
    from touchline.view.rerun_file import write_rerun

    path = tmp_path / "results.rrd"
    write_rerun(replay, path)
    assert [p.name for p in tmp_path.iterdir()] == ["results.rrd"]
    rows, arrows = Counter(), []
    for chunk in reader.RrdReader(path).stream():
        if not chunk.is_static:
            rows[chunk.entity_path] += chunk.num_rows
        if chunk.entity_path == "/world/contacts":
            batch = chunk.to_record_batch()
            columns = {name: batch.column(name) for name in batch.schema.names}
            assert "time" in columns and not {"log_time", "log_tick"} & columns.keys()
            (origins,) = (c.to_pylist() for name, c in columns.items() if "origins" in name)
            (vectors,) = (c.to_pylist() for name, c in columns.items() if "vectors" in name)
            for tails, ways in zip(origins, vectors, strict=True):
                arrows += [np.add(t, w) for t, w in zip(tails or [], ways or [], strict=True)]
    found = list(moments(replay))
    for link in found[0].poses:
        assert rows[f"/world/{link}"] == len(found)
    assert rows["/events"] == len(told(replay.events))
    assert rows["/estimates/tau_ext.joint1"] == sum(len(t) for t, _ in curves(replay))
    # Arrows end where the forces act.
    placed = [c.position for m in found for c in m.contacts if arrow(c) is not None]
    assert len(placed) >= 10
    np.testing.assert_allclose(np.array(arrows), np.array(placed, float), atol=1e-5)


@pytest.mark.parametrize("viewer", ["rerun", "foxglove"])
def test_a_missing_package_is_told_before_the_work(viewer, touched, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, viewer, None)
    out, file = tmp_path / "results", tmp_path / "file"
    arguments = ["analyze", str(touched.log), "--robot", "sara", "--out", str(out)]
    assert main([*arguments, f"--{viewer}", str(file)]) != 0
    assert f"touchline[{viewer}]" in capsys.readouterr().err
    assert not out.exists() and not file.exists()


def test_what_would_be_lost_is_told_before_the_work(touched, tmp_path, capsys):
    out, log = tmp_path / "results", tmp_path / "log.parquet"
    log.write_bytes(touched.log.read_bytes())
    arguments = ["analyze", str(log), "--robot", "sara", "--out", str(out), "--foxglove"]
    assert main([*arguments, str(log)]) == 2
    assert "is the recording" in capsys.readouterr().err
    assert main([*arguments, str(out / "events.json")]) == 2
    assert main(["analyze", str(log), str(log), *arguments[2:], str(tmp_path / "a.mcap")]) == 2
    assert "one recording" in capsys.readouterr().err
    assert not out.exists() and log.read_bytes() == touched.log.read_bytes()


def test_errors_name_the_file(replay, tmp_path):
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    from touchline.folder import replaced_file
    from touchline.view.foxglove_file import write_foxglove

    path = tmp_path / "results.mcap"
    with replaced_file(path) as draft:
        draft.write_bytes(b"mine")
        with pytest.raises(InputError, match=r"results\.mcap"):
            write_foxglove(replay, path)
    assert path.read_bytes() == b"mine"
