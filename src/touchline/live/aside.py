# SPDX-License-Identifier: Apache-2.0
"""A source that is read by a process of its own: what this program does costs it no sample.

The reading process sends frames over a socket of this machine: size (4 bytes), kind (1 byte) and
payload. A native thread takes the samples from it and feels with them.
"""

import gc
import os
import pickle
import select
import signal
import socket
import struct
import subprocess
import sys
import time

import numpy as np

from touchline.errors import InputError
from touchline.live.runner import Felt
from touchline.live.sample import Sample
from touchline.live.source import EndOfSource, LinkLost, Source
from touchline.live.streams import Stream
from touchline.model.robot import Robot
from touchline.native import core
from touchline.pipeline.pipeline import Pipeline

HEAD = struct.Struct("=IB")
OPENED, LOST, BAD, ENDED, STREAMS, SAMPLE = (ord(letter) for letter in "OLBETS")
OPEN, CLOSE = b"o", b"c"  # what the reading process is told
TELL = 0.005  # s between two words about the streams
IDLE = 0.02  # s that the reading process waits for samples or a command
START = 30.0  # s until the reading process must have answered; ROS 2 takes long to import
LEAVE = 2.0  # s that it may take to end
READ = 1 << 16  # bytes at once
# Of the reading process. With `-m` Python warns, since the package has imported the module already.
READING = "import sys; from touchline.live import aside; sys.exit(aside.main(int(sys.argv[1])))"


class ReadAside:
    """A source in a process of its own.

    Args:
        address: of the source, as `touchline live --source` takes it.
        robot: that it reads.
        streams: names of what arrives; the first makes the samples.
        period: between samples [s], where it is known beforehand.
    """

    def __init__(
        self, address: str, robot: Robot, streams: tuple[str, ...], period: float | None = None
    ) -> None:
        self.name, self._robot = address, robot
        self.period = period
        self.streams = tuple(Stream(name, period) for name in streams)
        self._process: subprocess.Popen[bytes] | None = None
        self._socket: socket.socket | None = None
        self._begun = b""
        self._felt: Felt | None = None
        self._reader: core.FrameReader | None = None
        self._ended = False

    def open(self) -> list[str]:
        """Starts the reading process, if it does not run, and lets it connect."""
        if self._process is None or self._process.poll() is not None:
            self._start()
        self._drop_reader()
        self._ended = False
        self._tell(OPEN)
        end = time.monotonic() + START
        while time.monotonic() < end:
            for kind, payload in self._frames(0.1, most=1):  # what follows are samples
                if kind == OPENED:
                    if self._felt is not None:
                        self._hand_over()
                    return pickle.loads(payload)
                self._take(kind, payload)
        self._kill()
        raise LinkLost(f"the process that reads it has not answered for {START:g} s")

    def _start(self) -> None:
        self._kill()
        ours, theirs = socket.socketpair()
        command = [sys.executable, "-c", READING, str(theirs.fileno())]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, pass_fds=[theirs.fileno()])
        theirs.close()
        self._socket, self._begun = ours, b""
        ours.setblocking(False)
        robot = self._robot
        setup = pickle.dumps((self.name, robot.description, robot.mechanism))
        assert self._process.stdin is not None
        self._process.stdin.write(setup)
        self._process.stdin.close()

    def _tell(self, command: bytes) -> None:
        assert self._socket is not None
        try:
            self._socket.sendall(command)
        except OSError:
            raise LinkLost("the process that reads it has ended") from None

    def _frames(self, timeout: float, most: int | None = None) -> list[tuple[int, bytes]]:
        """Whole frames that have come, at most so many: kind and payload."""
        assert self._socket is not None
        found = self._split(most)
        if found or not select.select([self._socket], [], [], timeout)[0]:
            return found
        data = self._socket.recv(READ)
        if not data:
            raise LinkLost("the process that reads it has ended")
        self._begun += data
        return self._split(most)

    def _split(self, most: int | None) -> list[tuple[int, bytes]]:
        """Takes whole frames, at most so many, from the front of what has come."""
        found, at, data = [], 0, self._begun
        while len(data) - at >= HEAD.size and (most is None or len(found) < most):
            size, kind = HEAD.unpack_from(data, at)
            if len(data) - at - HEAD.size + 1 < size:
                break
            found.append((kind, data[at + HEAD.size : at + HEAD.size - 1 + size]))
            at += HEAD.size - 1 + size
        self._begun = data[at:]
        return found

    def _take(self, kind: int, payload: bytes) -> Sample | None:
        """What a frame brings; a sample, if it is one."""
        if kind == SAMPLE:
            return self._sample(np.frombuffer(payload))
        if kind == STREAMS:
            for own, read in zip(self.streams, pickle.loads(payload), strict=True):
                refused = own.refused
                vars(own).update(vars(read))
                own.refused = refused
        elif kind == LOST:
            raise LinkLost(payload.decode())
        elif kind == BAD:
            problems = pickle.loads(payload)
            self._kill()
            raise InputError(problems)
        elif kind == ENDED:
            self._ended = True
        return None

    def _sample(self, numbers: np.ndarray) -> Sample:
        n, k = len(self._robot.joint_names), len(self._robot.sensor_names)
        parts = np.split(numbers[3:], np.cumsum([n, n, n, 6 * k]))
        q, qd, tau, wrench, ages = (part.copy() for part in parts)
        arrival, sequence = float(numbers[1]), int(numbers[0])
        wrench = wrench.reshape(k, 6)
        return Sample(float(numbers[2]), q, qd, tau, wrench, arrival, sequence, ages)

    def attach(self, pipeline: Pipeline) -> None:
        """From now on a native thread takes the samples, and the pipeline runs in another."""
        self._drop_reader()
        self._felt = Felt(self._robot, pipeline)
        self._hand_over()

    def _hand_over(self) -> None:
        assert self._socket is not None and self._felt is not None
        begun, self._begun = self._begun, b""
        self._reader = core.FrameReader(self._felt.runner, self._socket.fileno(), begun)

    def _drop_reader(self) -> None:
        if self._reader is not None:
            self._reader.stop()
            self._reader = None

    def read(self, timeout: float) -> list[Sample]:
        """The samples that have come; with results where a pipeline is attached."""
        if self._reader is None or self._felt is None:
            taken = (self._take(*frame) for frame in self._frames(timeout))
            found = [sample for sample in taken if sample is not None]
        else:
            found = self._felt.read(timeout)
            self.streams[0].refused = self._felt.runner.refused
            for frame in self._reader.told():
                self._take(frame[0], frame[1:])
            if not found and self._reader.fault:
                raise LinkLost(self._reader.fault)
        if self._ended and not found:
            raise EndOfSource
        return found

    def close(self) -> None:
        """Disconnects; the reading process stays for when the peer is back."""
        self._drop_reader()
        if self._socket is None:
            return
        try:
            self._tell(CLOSE)
        except LinkLost:
            self._kill()
            return
        end = time.monotonic() + LEAVE
        try:
            while time.monotonic() < end:
                if any(kind == ENDED for kind, _ in self._frames(0.05)):
                    return
        except LinkLost:
            pass
        self._kill()

    def _kill(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def __del__(self) -> None:
        self._kill()


class _Reading:
    """What goes on in the reading process."""

    def __init__(self, link: socket.socket, source: Source) -> None:
        self._link, self._source = link, source
        self._open, self._told = False, 0.0

    def run(self) -> None:
        """Obeys and reads until the other side has gone."""
        while True:
            ready = select.select([self._link], [], [], 0.0 if self._open else IDLE)[0]
            if ready:
                command = self._link.recv(1)
                if not command:
                    return
                self._obey(command)
            if self._open:
                self._read()

    def _obey(self, command: bytes) -> None:
        if self._open:
            self._source.close()
        self._open = False
        if command == CLOSE:
            self._send(ENDED, b"")
            return
        try:
            notes = self._source.open()
        except LinkLost as error:
            self._send(LOST, str(error).encode())
            return
        for stream in self._source.streams:
            stream.restart()
        self._send(STREAMS, pickle.dumps(self._source.streams))
        self._send(OPENED, pickle.dumps(notes))
        self._open = True

    def _read(self) -> None:
        try:
            samples = self._source.read(IDLE / 4)
        except LinkLost as error:
            self._source.close()
            self._open = False
            self._send(LOST, str(error).encode())
            return
        except EndOfSource:
            self._open = False
            self._send(ENDED, b"")
            return
        now = time.monotonic()
        frames = [_frame(SAMPLE, _numbers(sample)) for sample in samples]
        if now - self._told >= TELL:
            self._told = now
            frames.append(_frame(STREAMS, pickle.dumps(self._source.streams)))
        self._link.sendall(b"".join(frames))

    def _send(self, kind: int, payload: bytes) -> None:
        self._link.sendall(_frame(kind, payload))


def _frame(kind: int, payload: bytes) -> bytes:
    return HEAD.pack(1 + len(payload), kind) + payload


def _numbers(s: Sample) -> bytes:
    head = [float(s.sequence), s.arrival, s.time]
    return np.concatenate([head, s.q, s.qd, s.tau, s.wrench.ravel(), s.ages]).tobytes()


def settle() -> None:
    """Garbage collection leaves alone what is there: a whole one takes as long as many samples."""
    gc.collect()
    gc.freeze()


def main(number: int) -> int:
    """The reading process: `number` is that of its socket; standard input says what to read."""
    from touchline.live.schemes import own_source

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the program that started it
    link = socket.socket(fileno=number)
    name, description, mechanism = pickle.loads(sys.stdin.buffer.read())
    settle()
    core.go_ahead()
    try:
        _Reading(link, own_source(name, Robot(description, mechanism))).run()
    except InputError as error:
        link.sendall(_frame(BAD, pickle.dumps(error.problems)))
        while link.recv(READ):  # until it has been read
            pass
    except (BrokenPipeError, ConnectionResetError):
        pass
    os._exit(0)  # whatever threads a library has left
