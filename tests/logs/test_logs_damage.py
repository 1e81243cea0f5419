# SPDX-License-Identifier: Apache-2.0
"""Damaged files of every kind: a clear message or what is left of them, and little memory."""

import os
import tracemalloc

import numpy as np
import pytest
from bag_support import raw, storage_file, write_bag
from logs_support import describe, make_samples
from test_logs_rosbag import START, recording

from touchline.errors import InputError
from touchline.logs import open_log, read_log, write_table
from touchline.logs.mcap import McapFile

ROUNDS = int(os.environ.get("TOUCHLINE_DAMAGES", "60"))
LARGEST = 300e6  # bytes of memory, beside three times the file
KINDS = ("mcap", "mcap.zstd", "mcap.lone", "db3", "csv", "csv.gz", "parquet")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A whole file of each kind, by its ending."""
    folder = tmp_path_factory.mktemp("whole")
    robot = describe()
    found = {}
    for kind in ("csv", "csv.gz", "parquet"):
        found[kind] = folder / f"log.{kind}"
        write_table(found[kind], make_samples(800), robot)
    messages = recording(3.0)
    for kind in ("db3", "mcap"):
        found[kind] = storage_file(write_bag(folder / kind, messages, kind), kind)
    found["mcap.zstd"] = zipped(folder / "zstd.mcap", messages)
    found["mcap.lone"] = lone(folder / "lone.mcap", messages)
    return found


def text(words):
    data = words.encode()
    return len(data).to_bytes(4, "little") + data


def record(code, body):
    return bytes([code]) + len(body).to_bytes(8, "little") + body


def numbers(*pairs):
    return b"".join(value.to_bytes(size, "little") for value, size in pairs)


def bodies(messages):
    """The channels' records, and each message's."""
    topics = {topic: kind for topic, _, kind, _ in messages}
    head = b""
    for number, (topic, kind) in enumerate(topics.items(), 1):
        head += record(3, numbers((number, 2)) + text(kind) + text("ros2msg") + text(""))
        head += record(4, numbers((number, 2), (number, 2)) + text(topic) + text("cdr") + text(""))
    order = {topic: number for number, topic in enumerate(topics, 1)}
    parts = []
    for i, (topic, received, kind, message) in enumerate(messages):
        at = round(received * 1e9)
        start = numbers((order[topic], 2), (i, 4), (at, 8), (at, 8))
        parts.append((at, record(5, start + raw(message, kind))))
    return head, parts


MAGIC = b"\x89MCAP0\r\n"
END = record(15, bytes(4)) + record(2, bytes(20)) + MAGIC


def zipped(path, messages, claim=0):
    """Chunks compressed with zstd and lz4 in turn, without indexes and summary."""
    import lz4.frame
    from backports import zstd

    head, parts = bodies(messages)
    data = MAGIC + record(1, text("ros2") + text("test"))
    for n, first in enumerate(range(0, len(parts), 100)):
        some = parts[first : first + 100]
        content = (b"" if n else head) + b"".join(part for _, part in some)
        pack = zstd.compress if n % 2 else lz4.frame.compress
        times = [at for at, _ in some]
        size = claim or len(content)
        body = numbers((min(times), 8), (max(times), 8), (size, 8), (0, 4))
        body += text("zstd" if n % 2 else "lz4")
        squeezed = pack(content)
        data += record(6, body + len(squeezed).to_bytes(8, "little") + squeezed)
    path.write_bytes(data + END)
    return path


def lone(path, messages):
    head, parts = bodies(messages)
    start = MAGIC + record(1, text("ros2") + text("test"))
    path.write_bytes(start + head + b"".join(part for _, part in parts) + END)
    return path


def same(a, b):
    for name in ("time", "q", "qd", "tau", "wrench"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_all_forms_of_mcap_say_the_same(whole):
    robot = describe()
    reference = read_log(whole["mcap"], robot)
    for kind in ("mcap.zstd", "mcap.lone", "db3"):
        with open_log(whole[kind], robot) as log:
            (samples,) = log.chunks()
            assert log.warnings == [] and log.progress == 1.0
        same(samples, reference)


def test_chunks_that_overlap_are_merged(tmp_path):
    """As files are that were put together topic by topic."""
    messages = recording(6.0)
    sorted_by_topic = sorted(messages, key=lambda message: message[0])
    robot = describe()
    same(
        read_log(zipped(tmp_path / "a.mcap", sorted_by_topic), robot),
        read_log(zipped(tmp_path / "b.mcap", messages), robot),
    )


def test_absurd_times_of_receiving_move_only_their_messages(tmp_path):
    messages = recording(6.0)
    for i, at in ((50, 0.0), (300, 9e9), (500, 1.8e10)):
        messages[i] = (messages[i][0], at, *messages[i][2:])
    robot = describe()
    found = read_log(zipped(tmp_path / "a.mcap", messages), robot)
    plain = read_log(zipped(tmp_path / "b.mcap", recording(6.0)), robot)
    assert set(found.time) == set(plain.time)


@pytest.mark.parametrize("claim", [1 << 31, (1 << 64) - 1])
def test_a_chunk_that_claims_too_much_is_left_out(tmp_path, claim):
    path = zipped(tmp_path / "bomb.mcap", recording(3.0), claim)
    with pytest.raises(InputError, match="bomb.mcap"):
        open_log(path, describe())


def test_a_bomb_is_not_set_off(tmp_path):
    from backports import zstd

    content = zstd.compress(bytes(1 << 30))
    body = numbers((0, 8), (1, 8), (1 << 30, 8), (0, 4)) + text("zstd")
    body += len(content).to_bytes(8, "little") + content
    head, parts = bodies(recording(1.0))
    data = MAGIC + record(1, text("ros2") + text("t")) + head + record(6, body)
    path = tmp_path / "bomb.mcap"
    path.write_bytes(data + b"".join(part for _, part in parts) + END)
    tracemalloc.start()
    with open_log(path, describe()) as log:
        assert sum(len(chunk.time) for chunk in log.chunks()) == 100
        assert any("cannot be read whole" in warning for warning in log.warnings)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 50e6


def damaged(data, chance):
    """The bytes with one of the damages that files meet."""
    data = bytearray(data)
    at = int(chance.integers(len(data)))
    kind = chance.integers(6)
    if kind == 0:
        return data[:at]
    if kind == 1:
        for place in chance.integers(len(data), size=int(chance.integers(1, 30))):
            data[place] = chance.integers(256)
    elif kind == 2:
        size = int(chance.integers(1, 2000))
        data[at : at + size] = bytes(len(data[at : at + size]))
    elif kind == 3:
        data[at : at + 4] = int(chance.choice([2**31 - 1, 2**32 - 1, 2**26, 0])).to_bytes(
            4, "little"
        )
    elif kind == 4:
        del data[at : at + int(chance.integers(1, 5000))]
    else:
        data[at:at] = chance.bytes(int(chance.integers(1, 3000)))
    return data


@pytest.mark.parametrize("kind", KINDS)
def test_damage_costs_a_message_or_what_it_hits(whole, tmp_path, kind):
    """No error but `InputError`, one line per problem, and memory within bounds."""
    data = whole[kind].read_bytes()
    robot = describe()
    chance = np.random.default_rng(sum(map(ord, kind)))
    path = tmp_path / whole[kind].name
    refused = 0
    for _ in range(ROUNDS):
        path.write_bytes(bytes(damaged(data, chance)))
        tracemalloc.start()
        try:
            with open_log(path, robot) as log:
                for samples in log.chunks():
                    assert samples.q.shape == (len(samples.time), 2)
        except InputError as error:
            refused += 1
            assert all(path.name in p and "\n" not in p for p in error.problems if p), (
                error.problems
            )
        finally:
            _, peak = tracemalloc.get_traced_memory()
            tracemalloc.stop()
        assert peak < LARGEST + 3 * len(data)
    assert refused < ROUNDS or kind == "parquet"  # whose checksums find all there is
    if kind.startswith(("mcap", "db3")):
        assert refused < 0.6 * ROUNDS


def test_a_file_without_a_summary_is_counted(whole):
    for kind in ("mcap", "mcap.zstd", "mcap.lone"):
        file = McapFile(whole[kind])
        assert file.counts == {"/joint_states": 300, "/ft/wrench": 231}
        assert START < file.first * 1e-9 < file.last * 1e-9 < START + 4
        file.close()
