# SPDX-License-Identifier: Apache-2.0
"""A controller that speaks RTDE on the loopback, and the faults that its link can have.

It is written from the protocol's description and shares no code with the reader.
"""

import contextlib
import multiprocessing
import select
import socket
import struct
import threading
import time

KINDS = {
    "timestamp": ("DOUBLE", "d"),
    "actual_q": ("VECTOR6D", "6d"),
    "actual_qd": ("VECTOR6D", "6d"),
    "actual_current": ("VECTOR6D", "6d"),
    "actual_current_as_torque": ("VECTOR6D", "6d"),
    "ft_raw_wrench": ("VECTOR6D", "6d"),
    "actual_TCP_force": ("VECTOR6D", "6d"),
}


class FakeController:
    """Sends samples in real time to whoever asks.

    Args:
        samples: of a robot with six joints and one sensor.
        lacks: fields that are answered with NOT_FOUND.
        version: the newest protocol it speaks.
        rate: [Hz] at which samples are sent.
        tamper: changes the list of packages (number, bytes) that are due.
        apart: runs in a process of its own, which no stall of this one reaches.
    """

    def __init__(self, samples, lacks=(), version=2, rate=500.0, tamper=None, port=0, apart=False):
        self.samples, self.lacks, self.version, self.rate = samples, set(lacks), version, rate
        self.tamper = tamper or (lambda due: due)
        self.clock = 0.0  # s that are added to the time stamps
        self.paused = threading.Event()
        self.sent = 0
        self.log = []  # (monotonic, number) of each sample sent
        self._stop = threading.Event()
        self._listener = socket.socket()
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._listener.bind(("127.0.0.1", port))
        self._listener.listen(4)
        self.port = self._listener.getsockname()[1]
        if apart:
            self._thread = multiprocessing.get_context("fork").Process(target=self._serve)
        else:
            self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    @property
    def address(self):
        return f"ur://127.0.0.1:{self.port}"

    def stop(self):
        """As if its power had been cut, but for the operating system's farewell."""
        self._stop.set()
        if not isinstance(self._thread, threading.Thread):
            self._thread.terminate()
        self._thread.join(timeout=5)
        self._listener.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()

    def _serve(self):
        self._origin = time.monotonic()
        clients = []
        while not self._stop.is_set():
            wait = [self._listener, *(c.socket for c in clients)]
            ready, _, _ = select.select(wait, [], [], 0.0005)
            if self.paused.is_set():
                continue
            for client in list(clients):
                try:
                    if client.socket in ready:
                        client.hear()
                    client.send_due()
                except (OSError, ConnectionError):
                    clients.remove(client)
                    client.socket.close()
            if self._listener in ready:
                with contextlib.suppress(OSError):
                    clients.append(_Client(self, self._listener.accept()[0]))
        for client in clients:
            client.socket.close()


class _Client:
    def __init__(self, server, connection):
        self.server, self.socket = server, connection
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.buffer, self.fields, self.started, self.next = b"", [], False, 0

    def answer(self, kind, payload):
        self.socket.sendall(struct.pack(">HB", len(payload) + 3, kind) + payload)

    def hear(self):
        data = self.socket.recv(4096)
        if not data:
            raise ConnectionError
        self.buffer += data
        while len(self.buffer) >= 3:
            size, kind = struct.unpack(">HB", self.buffer[:3])
            if len(self.buffer) < size:
                return
            payload, self.buffer = self.buffer[3:size], self.buffer[size:]
            self.request(kind, payload)

    def request(self, kind, payload):
        if kind == ord("V"):
            (wanted,) = struct.unpack(">H", payload)
            self.answer(kind, bytes([wanted <= self.server.version]))
        elif kind == ord("v"):
            self.answer(kind, struct.pack(">4I", 5, 12, 0, 0))
        elif kind == ord("O"):
            names = [name for name in payload[8:].decode().split(",") if name]
            kinds = [
                "NOT_FOUND" if n in self.server.lacks or n not in KINDS else KINDS[n][0]
                for n in names
            ]
            whole = "NOT_FOUND" not in kinds
            self.fields = names if whole else []
            self.answer(kind, bytes([1 if whole else 0]) + ",".join(kinds).encode())
        elif kind == ord("I"):
            names = payload.decode().split(",")
            self.answer(kind, bytes([1]) + ",".join("INT32" for _ in names).encode())
        elif kind == ord("S"):
            self.started = True
            self.next = int((time.monotonic() - self.server._origin) * self.server.rate)
            self.answer(kind, b"\x01")
            text = b"hello"
            self.answer(ord("M"), bytes([len(text)]) + text + b"\x00\x03")
        elif kind == ord("P"):
            self.started = False
            self.answer(kind, b"\x01")

    def send_due(self):
        if not self.started:
            return
        now = int((time.monotonic() - self.server._origin) * self.server.rate)
        due = [(i, self.pack(i)) for i in range(self.next, now + 1)]
        self.next = now + 1
        if due:
            due = self.server.tamper(due)
        if due:
            self.socket.sendall(b"".join(data for _, data in due))
            self.server.sent += len(due)
            self.server.log += [(time.monotonic(), i) for i, _ in due]

    def pack(self, number):
        samples = self.server.samples
        i = number % len(samples)
        values = {
            "timestamp": [number / self.server.rate + self.server.clock],
            "actual_q": samples.q[i],
            "actual_qd": samples.qd[i],
            "actual_current": samples.tau[i] / 10.0,
            "actual_current_as_torque": samples.tau[i],
            "ft_raw_wrench": samples.wrench[i, 0],
            "actual_TCP_force": samples.wrench[i, 0],
        }
        body = b"".join(struct.pack(">" + KINDS[n][1], *values[n]) for n in self.fields)
        return struct.pack(">HB", len(body) + 4, ord("U")) + b"\x01" + body
