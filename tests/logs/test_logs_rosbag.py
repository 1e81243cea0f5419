# SPDX-License-Identifier: Apache-2.0
"""rosbag2 recordings: topics, clocks, rates, decoding and damage."""

import shutil
import sqlite3
import tracemalloc

import numpy as np
import pytest
from bag_support import JOINTS, STORE, WRENCH, joint_state, raw, storage_file, wrench, write_bag
from hypothesis import given, settings
from hypothesis import strategies as st
from logs_support import assert_same, describe

from touchline.errors import InputError
from touchline.logs import bagfile, open_log, read_log
from touchline.logs.cdr import JOINT_STATE, WRENCH_STAMPED, Decoder
from touchline.logs.messages import Messages
from touchline.model.description import JointDescription, SensorDescription
from touchline.observer.samples import Samples

NAMES = ("j1", "j2")
KINDS = ("db3", "mcap")
START = 1.7e9


def q_of(t):
    return np.stack([np.sin(3.0 * t), np.cos(2.0 * t)], axis=-1)


def wrench_of(t):
    """Straight lines, so that linear interpolation is exact."""
    return np.stack([t, -t, 2.0 * t, 0.1 * t, 0.0 * t, 1.0 - t], axis=-1)


def recording(seconds=4.0, rate=100.0, wrench_rate=77.0, start=START, seed=0):
    """Joint states and one wrench topic of another rate, both with jittering clocks."""
    rng = np.random.default_rng(seed)
    messages = []
    for t in np.arange(0.0, seconds, 1.0 / rate):
        t += rng.uniform(-1e-3, 1e-3) + 2e-3
        state = joint_state(start + t, NAMES, q_of(t), 0.1 * q_of(t), 10.0 * q_of(t))
        messages.append(("/joint_states", start + t + rng.uniform(0.0, 0.02), JOINTS, state))
    for t in np.arange(0.0, seconds, 1.0 / wrench_rate):
        t += rng.uniform(-1e-3, 1e-3) + 2e-3
        message = wrench(start + t, wrench_of(t))
        messages.append(("/ft/wrench", start + t + rng.uniform(0.0, 0.05), WRENCH, message))
    return sorted(messages, key=lambda item: item[1])


@pytest.fixture(scope="module")
def long_bags(tmp_path_factory):
    """One long recording of each kind; the MCAP one has several chunks."""
    # A sqlite table whose upper pages lie behind a cut cannot be read; this one has none there.
    seconds = {"db3": 60.0, "mcap": 100.0}
    folder = tmp_path_factory.mktemp("bags")
    return {kind: write_bag(folder / kind, recording(t), kind) for kind, t in seconds.items()}


@pytest.fixture
def long_bag(long_bags, tmp_path):
    """A copy that a test may damage: its folder and file."""

    def copy(kind):
        folder = shutil.copytree(long_bags[kind], tmp_path / kind)
        return folder, storage_file(folder, kind)

    return copy


def check_recording(samples):
    t = samples.time - START
    tight = {"rtol": 0.0, "atol": 1e-6}  # stamps since 1970 resolve 0.24 us
    np.testing.assert_allclose(samples.q, q_of(t), **tight)
    np.testing.assert_allclose(samples.qd, 0.1 * q_of(t), **tight)
    np.testing.assert_allclose(samples.tau, 10.0 * q_of(t), atol=1e-5)
    known = np.isfinite(samples.wrench[:, 0, 0])
    assert known[10:-10].all()
    np.testing.assert_allclose(samples.wrench[known, 0], wrench_of(t)[known], atol=3e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_round_trip_of_folder_and_file(tmp_path, kind):
    folder = write_bag(tmp_path / "bag", recording(), kind)
    robot = describe()
    from_folder = read_log(folder, robot)
    assert len(from_folder.time) == 400
    check_recording(from_folder)
    assert_same(read_log(storage_file(folder, kind), robot), from_folder)
    with open_log(folder, robot) as log:
        assert log.topics == {"/joint_states": JOINTS, "/ft/wrench": WRENCH}
        assert log.duration == pytest.approx(4.0, abs=0.1)
        list(log.chunks())
        assert log.progress == 1.0 and log.warnings == []


@pytest.mark.parametrize("rows", [17, 1000])
def test_numbers_do_not_depend_on_chunks(tmp_path, rows, monkeypatch):
    messages = recording(seconds=12.0)
    sensor = SensorDescription("base", "link", delay=0.013)
    robot = describe([JointDescription("j1", delay=0.021), JointDescription("j2")], [sensor])
    # Wrong stamps of a wrench and of a joint state, and a pause of the sensor.
    messages[300] = (*messages[300][:3], wrench(START + 1e6, np.zeros(6)))
    messages[300] = ("/ft/wrench", *messages[300][1:2], WRENCH, messages[300][3])
    pause = START + 6.0, START + 7.0
    messages = [m for m in messages if m[0] != "/ft/wrench" or not pause[0] < m[1] < pause[1]]
    folder = write_bag(tmp_path / "bag", messages)
    whole = read_log(folder, robot)
    monkeypatch.setattr("touchline.logs.rosbag._BATCH", 50)
    monkeypatch.setattr("touchline.logs.sqlitebag._BATCH", 31)
    with open_log(folder, robot) as log:
        chunks = list(log.chunks(rows))
    names = ("time", "q", "qd", "tau", "wrench")
    joined = {n: np.concatenate([getattr(c, n) for c in chunks]) for n in names}
    assert_same(Samples(**joined), whole)
    inner = np.abs(whole.time - START - 6.5) < 0.3
    assert np.isnan(whole.wrench[inner]).all()
    # A delayed wrench is that of a later message: the straight lines are read 13 ms on.
    t = whole.time - START
    late = (t > 8.0) & (t < 11.9)
    np.testing.assert_allclose(whole.wrench[late, 0], wrench_of(t[late] + 0.013), atol=3e-6)


def messages(data):
    return Messages.of(data, [0] * len(data), [0] * len(data))


def expected(data, kind):
    """What the rosbags package makes of one message, as (stamp, names, arrays)."""
    read = STORE.deserialize_cdr(data, kind)
    stamp = read.header.stamp.sec + read.header.stamp.nanosec * 1e-9
    if kind == JOINTS:
        return stamp, read.name, [read.position, read.velocity, read.effort]
    parts = (read.wrench.force, read.wrench.torque)
    return stamp, (), [[getattr(part, axis) for part in parts for axis in "xyz"]]


def test_messages_are_decoded_as_rosbags_does():
    rng = np.random.default_rng(0)
    data = []
    for i in range(120):
        names = [("j1", "j2"), ("j2", "x", "j1"), ("gripper",), ("j1", "j2x")][i % 4]
        n = len(names)
        values = [rng.normal(size=n) if (i >> b) % 3 else () for b in range(3)]
        frame = "base" if i % 7 else "another frame"
        message = joint_state(rng.uniform(0, 2e9), names, *values, frame=frame)
        data.append(bytes(STORE.serialize_cdr(message, JOINTS, little_endian=bool(i % 5))))
    decoder = Decoder(JOINT_STATE, NAMES)
    broken = [b"\x00\x01broken", data[0][:-20], b"", b"\x00\x03" + data[1][2:]]
    decoded = decoder.decode(messages([*broken, *data]))
    assert np.isnan(decoded.stamps[: len(broken)]).all() and decoder.undecodable == len(broken)
    assert decoder.seen == ["j1", "j2", "x", "gripper", "j2x"]
    assert not decoded.complete[: len(broken)].any()
    for i, raw_message in enumerate(data, len(broken)):
        stamp, names, arrays = expected(raw_message, JOINTS)
        assert decoded.stamps[i] == stamp and decoded.complete[i] == (set(NAMES) <= set(names))
        for found, array in zip(decoded.fields.values(), arrays, strict=True):
            whole = decoded.complete[i] and len(array) == len(names)
            wanted = [array[names.index(n)] for n in NAMES] if whole else [np.nan] * 2
            np.testing.assert_array_equal(found[i], wanted)


@pytest.mark.parametrize("little_endian", [True, False])
def test_wrenches_are_decoded_as_rosbags_does(little_endian):
    rng = np.random.default_rng(1)
    made = [wrench(i + 0.5, rng.normal(size=6), "f" * (i % 9)) for i in range(50)]
    data = [bytes(STORE.serialize_cdr(m, WRENCH, little_endian=little_endian)) for m in made]
    decoder = Decoder(WRENCH_STAMPED)
    decoded = decoder.decode(messages([*data, data[0][:40]]))
    assert decoder.undecodable == 1 and np.isnan(decoded.fields["wrench"][-1]).all()
    for i, raw_message in enumerate(data):
        stamp, _, (values,) = expected(raw_message, WRENCH)
        assert decoded.stamps[i] == stamp
        np.testing.assert_array_equal(decoded.fields["wrench"][i], values)


def test_newer_encapsulation_aligns_to_four_bytes():
    names = b"".join((2).to_bytes(4, "little") + n + b"\0" + bytes(2) for n in (b"a", b"b"))
    body = bytes(8) + (1).to_bytes(4, "little") + bytes(4) + (2).to_bytes(4, "little") + names
    for k in range(3):
        body += (2).to_bytes(4, "little") + np.array([10.0 * k, 10.0 * k + 1]).tobytes()
    decoded = Decoder(JOINT_STATE, ("b",)).decode(messages([b"\x00\x07\0\0" + body]))
    assert [v[0, 0] for v in decoded.fields.values()] == [1.0, 11.0, 21.0]


@pytest.mark.parametrize("length", [0x03FFFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 5000])
@pytest.mark.parametrize("at", [12, 20, 24, 32, 40, 68, 88])
def test_a_damaged_length_costs_its_message(at, length):
    data = [raw(joint_state(i, NAMES, (i, 0), (1, 2), (3, 4)), JOINTS) for i in range(700)]
    bad = bytearray(data[350])
    bad[at : at + 4] = length.to_bytes(4, "little")
    data[350] = bytes(bad)
    decoder = Decoder(JOINT_STATE, NAMES)
    tracemalloc.start()
    decoded = decoder.decode(messages(data))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1e6
    others = np.arange(700) != 350
    np.testing.assert_array_equal(decoded.fields["position"][others, 0], np.flatnonzero(others))
    assert decoded.complete[others].all() and decoder.undecodable <= 1


@settings(max_examples=300)
@given(st.binary(max_size=300), st.integers(0, 299), st.binary(max_size=12), st.booleans())
def test_any_bytes_cost_one_message(noise, at, patch, whole):
    good = raw(joint_state(7.0, NAMES, (1, 2), (1, 2), (3, 4)), JOINTS)
    bad = noise if whole else good[:at] + patch + good[at + len(patch) :]
    decoder = Decoder(JOINT_STATE, NAMES)
    decoded = decoder.decode(messages([good, bad, good]))
    assert decoded.stamps[[0, 2]].tolist() == [7.0, 7.0] and decoder.undecodable <= 1
    assert decoded.fields["effort"][[0, 2]].tolist() == [[3.0, 4.0]] * 2
    other = Decoder(WRENCH_STAMPED)
    assert len(other.decode(messages([bad])).stamps) == 1
    for name in decoder.seen:
        assert isinstance(name, str)


def test_names_factors_and_several_publishers(tmp_path):
    messages = []
    for i in range(50):
        t = 0.01 * i
        swapped = joint_state(t, ("arm_b", "arm_a"), (2, 1), (20, 10), (200, 100))
        messages.append(("/joint_states", t, JOINTS, swapped))
        gripper = joint_state(t, ("finger",), (0.04,))
        messages.append(("/joint_states", t + 0.001, JOINTS, gripper))
    names = {"j1": "arm_a", "j2": "arm_b"}
    log = {"joint_names": names, "tau": {"factor": -0.5}}
    robot = describe([JointDescription("j1"), JointDescription("j2", torque="none")], (), log)
    samples = read_log(write_bag(tmp_path / "bag", messages), robot)
    assert len(samples.time) == 50
    np.testing.assert_array_equal(samples.q, [[1.0, 2.0]] * 50)
    np.testing.assert_array_equal(samples.qd, [[10.0, 20.0]] * 50)
    np.testing.assert_array_equal(samples.tau[:, 0], -50.0)
    assert np.isnan(samples.tau[:, 1]).all()


def test_two_sensors_and_axes(tmp_path):
    messages = recording(2.0)
    messages += [("/wrist/ft", *m[1:]) for m in messages if m[0] == "/ft/wrench"]
    messages.sort(key=lambda item: item[1])
    wrist = SensorDescription("wrist", "link", axes=("fz", "mx"))
    log = {"topics": {"wrench": {"base": "/ft/wrench"}}, "sensors": {"wrist": {"factor": 2.0}}}
    samples = read_log(write_bag(tmp_path / "bag", messages), describe(2, ["base", wrist], log))
    lacking = np.isnan(samples.wrench[20:-20, 1]).all(axis=0)
    assert lacking.tolist() == [True, True, False, False, True, True]
    np.testing.assert_array_equal(samples.wrench[:, 1, 2], 2.0 * samples.wrench[:, 0, 2])


def test_missing_velocities_are_estimated(tmp_path):
    messages = [
        ("/joint_states", t, JOINTS, joint_state(t, NAMES, (t**2, 5 * t), (), (1, 2)))
        for t in np.arange(1, 200) * 0.01
    ]
    robot = describe(2, ())
    with open_log(write_bag(tmp_path / "bag", messages), robot) as log:
        (samples,) = log.chunks()
        assert "no velocities of j1, j2" in log.warnings[0]
    np.testing.assert_allclose(samples.qd[:, 0], 2.0 * samples.time, atol=1e-6)
    np.testing.assert_allclose(samples.qd[:, 1], 5.0, atol=1e-6)


def test_unstamped_headers_use_the_receive_time(tmp_path):
    messages = [
        ("/joint_states", 5.0 + t, JOINTS, joint_state(0.0, NAMES, (t, t), (1, 1), (1, 2)))
        for t in np.arange(20) * 0.01
    ]
    with open_log(write_bag(tmp_path / "bag", messages), describe(2, ())) as log:
        (samples,) = log.chunks()
        np.testing.assert_allclose(samples.time, 5.0 + np.arange(20) * 0.01)
        assert "receive time" in log.warnings[0]


def test_one_zero_stamp_is_left_alone(tmp_path):
    messages = [
        ("/joint_states", 5.0 + t, JOINTS, joint_state(t, NAMES, (t, t), (1, 1), (1, 2)))
        for t in np.arange(20) * 0.01
    ]
    with open_log(write_bag(tmp_path / "bag", messages), describe(2, ())) as log:
        (samples,) = log.chunks()
        np.testing.assert_allclose(samples.time, np.arange(20) * 0.01, atol=1e-12)
        assert log.warnings == []


def test_foreign_clock_and_silent_sensor_are_told(tmp_path):
    messages = [
        (m[0], m[1], m[2], wrench(5.0, np.ones(6)) if m[0] == "/ft/wrench" else m[3])
        for m in recording(1.0)
    ]
    robot = describe(2, ["base", "wrist"], {"topics": {"wrench": {"base": "/ft/wrench"}}})
    folder = write_bag(tmp_path / "bag", messages, silent=[("/wrist/wrench", WRENCH)])
    with open_log(folder, robot) as log:
        (samples,) = log.chunks()
        text = "\n".join(log.warnings)
    assert "/ft/wrench: its clock is" in text
    assert "/wrist/wrench: no messages" in text
    assert np.isnan(samples.wrench).all() and np.isfinite(samples.tau).all()


@pytest.mark.parametrize(
    ("topics", "log", "words"),
    [
        (["/a", "/b"], {}, ["several topics carry sensor_msgs/msg/JointState (/a, /b)", "choose"]),
        ([], {}, ["no topic carries sensor_msgs/msg/JointState"]),
        (["/a"], {"topics": {"joint_states": "/A"}}, ["no topic '/A'", "/a (sensor_msgs"]),
        (["/a"], {"topics": {"joint_states": "/ft"}}, ["/ft carries geometry_msgs"]),
    ],
)
def test_topics_that_cannot_be_chosen(tmp_path, topics, log, words):
    messages = [(t, 1.0, JOINTS, joint_state(1.0, NAMES, (1, 2))) for t in topics]
    messages.append(("/ft", 2.0, WRENCH, wrench(2.0, np.ones(6))))
    with pytest.raises(InputError) as caught:
        open_log(write_bag(tmp_path / "bag", messages), describe(log=log))
    for word in [*words, "/ft (geometry_msgs/msg/WrenchStamped)"]:
        assert word in str(caught.value)


def test_several_wrench_topics_need_a_choice(tmp_path):
    messages = [("/js", 1.0, JOINTS, joint_state(1.0, NAMES, (1, 2), (1, 2), (1, 2)))]
    messages += [(t, 2.0, WRENCH, wrench(2.0, np.ones(6))) for t in ("/x", "/y")]
    folder = write_bag(tmp_path / "bag", messages)
    with pytest.raises(InputError, match=r"wrench: \{wrist: /TOPIC\}"):
        open_log(folder, describe(2, ("base", "wrist")))
    both = {"topics": {"wrench": {"base": "/x", "wrist": "/x"}}}
    with pytest.raises(InputError, match="/x serves several sensors: base, wrist"):
        open_log(folder, describe(2, ("base", "wrist"), both))


@pytest.mark.parametrize(
    ("names", "values", "words"),
    [
        (
            ("j1", "jj2"),
            [(1, 2)] * 3,
            ["no joint 'j2' (did you mean 'jj2'?)", "joints of", "j1, jj2"],
        ),
        (NAMES, [(1, 2), (1, 2), ()], ["no joint torques", "no efforts"]),
        (NAMES, [(), (1, 2), (1, 2)], ["no positions"]),
    ],
)
def test_joint_states_that_cannot_be_used(tmp_path, names, values, words):
    messages = [("/js", 0.1 * i, JOINTS, joint_state(0.1 * i, names, *values)) for i in range(9)]
    with pytest.raises(InputError) as caught:
        open_log(write_bag(tmp_path / "bag", messages), describe(2, ()))
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("kind", KINDS)
def test_files_that_are_no_recordings(tmp_path, kind):
    path = tmp_path / f"log.{kind}"
    path.write_bytes(b"something else" * 500)
    with pytest.raises(InputError, match="not a readable recording"):
        open_log(path, describe())
    path.write_bytes(b"")
    with pytest.raises(InputError, match="empty"):
        open_log(path, describe())
    folder = write_bag(tmp_path / "bag", [], kind, silent=[("/js", JOINTS)])
    with pytest.raises(InputError, match="no messages"):
        open_log(folder, describe())


@pytest.mark.parametrize("packed", ["FILE", "MESSAGE"])
def test_packed_bags_say_the_same(tmp_path, packed, monkeypatch):
    monkeypatch.setattr(bagfile, "_BATCH", 100)
    robot, messages = describe(), recording()
    plain = read_log(write_bag(tmp_path / "plain", messages), robot)
    folder = write_bag(tmp_path / "bag", messages, packed=packed)
    with open_log(folder, robot) as log:
        assert log.topics == {"/joint_states": JOINTS, "/ft/wrench": WRENCH}
        assert log.duration == pytest.approx(4.0, abs=0.1)
        (samples,) = log.chunks()
        assert log.progress == 1.0 and log.warnings == []
    assert_same(samples, plain)


def test_a_packed_bag_that_is_damaged_is_read_as_far_as_it_goes(tmp_path):
    """Of messages that are packed one by one, those before the damage are used."""
    messages = recording()
    folder = write_bag(tmp_path / "bag", messages, packed="MESSAGE")
    file = storage_file(folder, "db3")
    with sqlite3.connect(file) as table:
        table.execute("UPDATE messages SET data = x'00' WHERE id = 600")
    table.close()
    with open_log(folder, describe()) as log:
        (part,) = log.chunks()
        assert "damaged after 599 messages" in log.warnings[0]
    whole = read_log(write_bag(tmp_path / "plain", messages), describe())
    assert 300 < len(part.time) < 400
    np.testing.assert_array_equal(part.q, whole.q[: len(part.time)])


def test_messages_that_a_damaged_index_does_not_lead_to_are_told(tmp_path):
    messages = recording()
    folder = write_bag(tmp_path / "bag", messages)
    file = storage_file(folder, "db3")
    with sqlite3.connect(file) as table:
        (stamp,) = table.execute("SELECT timestamp FROM messages WHERE id = 300").fetchone()
    table.close()
    data = bytearray(file.read_bytes())
    # A record of the index: the size of its head, the kinds of its two numbers (eight bytes, two),
    # then the time.
    at = data.index(bytes([3, 6, 2]) + stamp.to_bytes(8, "big"))
    data[at + 1] = 0  # no time, as it is read now
    file.write_bytes(data)
    with open_log(folder, describe()) as log:
        (part,) = log.chunks()
        assert any("its index is damaged; 1 messages" in text for text in log.warnings)
    whole = read_log(write_bag(tmp_path / "plain", messages), describe())
    assert abs(len(part.time) - len(whole.time)) <= 1


def test_a_packed_file_that_is_none_is_told(tmp_path):
    folder = write_bag(tmp_path / "bag", recording(1.0), packed="FILE")
    (file,) = folder.glob("*.zstd")
    file.write_bytes(b"something else")
    with pytest.raises(InputError, match="not a readable recording, or damaged"):
        open_log(folder, describe())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[", "reading the folder's files alone"),
        ("rosbag2_bagfile_information: 3", "reading the folder's files alone"),
        (None, "not every file that metadata.yaml names is there"),
    ],
)
def test_metadata_that_cannot_be_trusted_is_told(tmp_path, text, words):
    folder = write_bag(tmp_path / "bag", recording(1.0))
    whole = read_log(folder, describe())
    path = folder / "metadata.yaml"
    path.write_text(path.read_text().replace("bag.db3", "b.db3") if text is None else text)
    with open_log(folder, describe()) as log:
        (samples,) = log.chunks()
        assert words in log.warnings[0]
    assert_same(samples, whole)


def test_folder_without_recording(tmp_path):
    with pytest.raises(InputError, match="holds no rosbag2"):
        open_log(tmp_path, describe())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("keep", [0.7, 0.9, 0.999])
def test_cut_off_file_is_read_as_far_as_it_goes(long_bag, kind, keep):
    folder, file = long_bag(kind)
    robot = describe()
    whole = read_log(file, robot)
    file.write_bytes(file.read_bytes()[: int(keep * file.stat().st_size)])
    with open_log(file, robot) as log:
        (part,) = log.chunks()
        assert "damaged after" in log.warnings[0]
    rows = len(part.time)
    assert 0.3 * len(whole.time) < rows <= len(whole.time)
    kept = np.isin(whole.time, part.time)
    assert kept.sum() == rows and kept[: rows - 40].all()  # a few before the cut may be lost
    np.testing.assert_array_equal(part.q, whole.q[kept])
    np.testing.assert_array_equal(part.wrench[: rows - 90], whole.wrench[: rows - 90])
    with open_log(folder, robot) as log:  # metadata.yaml promises more than there is
        assert sum(len(c.time) for c in log.chunks()) == rows


def test_beginning_of_a_file(tmp_path):
    file = storage_file(write_bag(tmp_path / "a", recording(3.0), "db3"), "db3")
    file.write_bytes(file.read_bytes()[:6000])
    with pytest.raises(InputError, match="not a readable recording, or damaged"):
        open_log(file, describe())
    file = storage_file(write_bag(tmp_path / "b", recording(3.0), "mcap"), "mcap")
    whole = read_log(file, describe())
    file.write_bytes(file.read_bytes()[:16000])  # in the midst of the first chunk
    part = read_log(file, describe())
    assert 10 < len(part.time) < 200
    np.testing.assert_array_equal(part.q, whole.q[: len(part.time)])
    file.write_bytes(file.read_bytes()[:600])
    with pytest.raises(InputError, match="damaged"):
        open_log(file, describe())


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_bytes_in_the_middle_of_a_file(long_bag, kind):
    _, file = long_bag(kind)
    whole = read_log(file, describe())
    data = bytearray(file.read_bytes())
    at = int(0.6 * len(data))
    data[at : at + 20000] = b"\xff" * 20000
    file.write_bytes(bytes(data))
    with open_log(file, describe()) as log:
        (part,) = log.chunks()
        assert "damaged after" in log.warnings[0]
    kept = np.isin(whole.time, part.time)
    assert kept.sum() == len(part.time)
    np.testing.assert_array_equal(part.q, whole.q[kept])
    assert 0.9 * len(kept) < kept.sum() < len(kept)  # what stands behind it is not lost
    assert kept[:1000].all() and kept[-100:].all()
    data[4096:] = b"\xff" * (len(data) - 4096)
    file.write_bytes(bytes(data))
    if kind == "db3":
        with pytest.raises(InputError, match="damaged"):
            open_log(file, describe())
    else:
        assert 0 < len(read_log(file, describe()).time) < 30


def test_recording_whose_recorder_was_killed(tmp_path):
    folder = write_bag(tmp_path / "bag", recording(2.0), "db3")
    (folder / "metadata.yaml").unlink()
    file = storage_file(folder, "db3")
    shutil.copy(file, folder / "bag_10.db3")
    file.rename(folder / "bag_9.db3")
    (folder / "bag_10.db3-wal").write_bytes(b"some pages")
    with open_log(folder, describe()) as log:
        assert sum(len(c.time) for c in log.chunks()) == 400
        assert "bag_10.db3-wal" in log.warnings[0]


def test_real_recordings(data):
    folder = data / "panda_ur10_rosbag2"
    panda = describe([f"fer_joint{i}" for i in range(1, 8)], ())
    samples = read_log(folder / "panda_exciting_trajectory.db3", panda)
    assert samples.q.shape == (727, 7)
    assert np.median(np.diff(samples.time)) == pytest.approx(1 / 30, rel=0.01)
    # The velocities are those of the positions.
    steps = np.diff(samples.q, axis=0) / np.diff(samples.time)[:, None]
    assert np.corrcoef(steps[:, 3], samples.qd[1:, 3])[0, 1] > 0.99
    links = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
    ur10 = describe([f"{name}_joint" for name in links], ())
    samples = read_log(folder / "ur10_exciting_trajectory.db3", ur10)
    assert samples.tau.shape == (3441, 6) and np.isfinite(samples.tau).all()
    with pytest.raises(InputError, match="no topic carries"):
        open_log(folder / "validation_trajectory.db3", ur10)
