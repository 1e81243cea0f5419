# SPDX-License-Identifier: Apache-2.0
"""Which sockets a process and its children listen at (Linux)."""

import os
from pathlib import Path

LISTENS = "0A"  # state of a TCP socket
LOOPBACK = ("0100007F", "00000000000000000000000001000000")


def family(pid):
    """The process and all that it has started."""
    found = [pid]
    for tasks in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in tasks.read_text().split():
            found += family(int(child))
    return found


def listening(pid):
    """(kind, address in hexadecimal, port) of TCP sockets that listen and of all UDP sockets."""
    own = set()
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        try:
            target = os.readlink(entry)
        except OSError:
            continue
        if target.startswith("socket:["):
            own.add(target[8:-1])
    found = []
    for kind in ("tcp", "tcp6", "udp", "udp6"):
        table = Path(f"/proc/{pid}/net/{kind}")
        for line in table.read_text().splitlines()[1:] if own else ():
            cells = line.split()
            address, port = cells[1].split(":")
            if cells[9] in own and (kind.startswith("udp") or cells[3] == LISTENS):
                found.append((kind, address, int(port, 16)))
    return found
