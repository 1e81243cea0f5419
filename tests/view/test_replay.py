# SPDX-License-Identifier: Apache-2.0
"""A replay shows what the analysis found, at the time it is asked for."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

from touchline.errors import InputError
from touchline.report.outputs import strict
from touchline.view.replay import Replay, is_results, read_origin


@pytest.fixture(scope="module")
def replay(touched):
    return Replay(touched.out)


def test_the_arm_stands_as_it_was_measured(replay, touched):
    samples = touched.samples
    for row in (0, 17, 333, len(samples.time) - 1):
        q = replay.posture(float(samples.time[row]))
        # Straight between postures 10 ms apart: off by qdd dt^2 / 8.
        np.testing.assert_allclose(q, samples.q[row], atol=2e-4)
    np.testing.assert_array_equal(replay.posture(-5.0), samples.q[0])
    assert np.abs(replay.posture(99.0) - samples.q[-1]).max() < 0.02


def test_events_come_back_as_they_were(replay, touched):
    assert len(replay.events) == len(touched.analysis.events) >= 3
    for mine, own in zip(replay.events, touched.analysis.events, strict=True):
        assert strict(mine.as_json()) == strict(own.as_json())


def test_contacts_are_the_rows_of_the_table(replay, touched):
    table = pq.read_table(touched.out / "contacts.parquet").to_pylist()
    for row in table[:: len(table) // 20]:
        contacts = replay.contacts(row["time"] + 1e-6)
        (contact,) = (c for c in contacts if c.event == row["event"])
        assert (contact.segment, contact.link, contact.status) == (
            row["segment"],
            row["link"],
            row["status"],
        )
        if row["x"] is not None:
            np.testing.assert_array_equal(contact.position, [row[axis] for axis in "xyz"])
            assert contact.position_std == pytest.approx(row["position_std"])
            assert contact.wrench is None
        else:
            np.testing.assert_array_equal(contact.wrench[3:], [row[f"m{axis}"] for axis in "xyz"])
        np.testing.assert_array_equal(contact.force, [row[f"f{axis}"] for axis in "xyz"])


def test_nothing_is_shown_between_events(replay, touched):
    first = min(event.detected for event in replay.events)
    assert replay.contacts(first - 0.002) == []
    last = max(event.cleared for event in replay.events)
    assert replay.contacts(last + 1e-4) == []


def test_the_truth_of_a_simulated_log_is_shown_while_it_lasts(replay, touched):
    truth = touched.truth
    links = {truth.links[i] for i in np.unique(truth.link) if i >= 0}
    assert len(replay.truth) == 3 and {contact.link for contact in replay.truth} == links
    for row in range(0, len(touched.samples.time), 97):
        slots = np.flatnonzero(truth.link[row] >= 0)
        shown = replay.true_contacts(float(touched.samples.time[row]))
        assert len(shown) == len(slots)
        for slot, (point, force) in zip(slots, shown, strict=True):
            np.testing.assert_array_equal(point, truth.point[row, slot])
            np.testing.assert_array_equal(force, truth.force[row, slot])


def test_a_replay_does_without_the_log(touched, tmp_path):
    for path in touched.out.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    known = json.loads((tmp_path / "analysis.json").read_text())
    (tmp_path / "analysis.json").write_text(json.dumps(known | {"log": "/gone/log.parquet"}))
    assert Replay(tmp_path).truth == []


def test_a_curve_holds_the_extremes_of_its_pieces(replay, touched):
    table = pq.read_table(touched.out / "estimates.parquet")
    time = table["time"].to_numpy()
    for name in ("tau_ext.joint3", "base.seg.fx"):
        values = table[name].to_numpy()
        for begin, end in ((time[0], time[-1] + 1e-3), (0.3, 0.45)):
            x, y = replay.curve(name, float(begin), float(end), 50)
            inside = values[(time >= begin) & (time < end)]
            assert len(x) == len(y) == 100 and (np.diff(x) > 0).all()
            assert np.nanmin(y) == np.nanmin(inside) and np.nanmax(y) == np.nanmax(inside)
    fine = replay.curve("tau_ext.joint3", float(time[300]), float(time[310]), 10)[1]
    np.testing.assert_array_equal(fine[::2], table["tau_ext.joint3"].to_numpy()[300:310])


def test_the_table_is_read_in_parts(touched, monkeypatch):
    whole = Replay(touched.out)
    table = pq.read_table(touched.out / "estimates.parquet")
    folder = touched.out.parent / "parts"
    folder.mkdir(exist_ok=True)
    for path in touched.out.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    pq.write_table(table, folder / "estimates.parquet", row_group_size=100)
    contacts = pq.read_table(touched.out / "contacts.parquet")
    pq.write_table(contacts, folder / "contacts.parquet", row_group_size=64)
    parts = Replay(folder)
    assert parts.estimates.groups > 5 and whole.estimates.groups == 1
    for a, b in zip(
        parts.curve("base.seg.fz", 0.2, 0.9, 77), whole.curve("base.seg.fz", 0.2, 0.9, 77),
        strict=True,
    ):  # fmt: skip
        np.testing.assert_array_equal(a, b)
    for t in np.linspace(0.2, 1.0, 30):
        a, b = parts.contacts(t), whole.contacts(t)
        assert [(c.event, c.link) for c in a] == [(c.event, c.link) for c in b]


def test_what_is_no_result_is_refused(touched, tmp_path):
    assert is_results(touched.out) and not is_results(tmp_path)
    (tmp_path / "events.json").write_text("[]")
    with pytest.raises(InputError, match=r"estimates.parquet.*missing"):
        read_origin(tmp_path)
    for path in touched.out.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    table = pq.read_table(tmp_path / "postures.parquet")
    pq.write_table(table.drop_columns(["q.joint4"]), tmp_path / "postures.parquet")
    with pytest.raises(InputError, match="give the robot of the recording"):
        Replay(tmp_path)
    for broken in ("{}", "no", json.dumps({"log": 1})):
        (tmp_path / "analysis.json").write_text(broken)
        with pytest.raises(InputError, match=r"analysis.json: cannot be understood"):
            read_origin(tmp_path)
    (tmp_path / "events.json").write_text('[{"id": 0}]')
    (tmp_path / "analysis.json").write_bytes((touched.out / "analysis.json").read_bytes())
    with pytest.raises(InputError, match=r"events.json: cannot be understood"):
        Replay(tmp_path)
