# SPDX-License-Identifier: Apache-2.0
"""Workers do what they are given, begin as they are told, and end with the one they work for."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from touchline.workers import workers

BEGUN: list[str] = []
SOON = 20.0  # s


def begin(word: str) -> None:
    BEGUN.append(word)


def begun(number: int) -> tuple[int, list[str]]:
    return number, BEGUN


def note_and_wait(folder: str, number: int) -> None:
    (Path(folder) / f"{number}").write_text(str(os.getpid()))
    time.sleep(600.0)


def ask_for_long_work(folder: str) -> None:
    with workers(2) as pool:
        list(pool.map(note_and_wait, [folder] * 2, range(2)))


def lives(process: int) -> bool:
    """A zombie, for which nobody has asked yet, has ended."""
    state = Path(f"/proc/{process}/stat")
    return state.exists() and state.read_text().rsplit(")", 1)[1].split()[0] != "Z"


def wait_until(holds) -> None:
    late = time.monotonic() + SOON
    while not holds():
        assert time.monotonic() < late
        time.sleep(0.05)


def test_each_begins_as_told_and_does_what_it_is_given():
    with workers(2, begin, "ready") as pool:
        assert list(pool.map(begun, range(3))) == [(i, ["ready"]) for i in range(3)]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="asks Linux which processes live")
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_they_end_with_a_process_that_is_killed(tmp_path, how):
    code = f"from test_workers import ask_for_long_work; ask_for_long_work({str(tmp_path)!r})"
    guard = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
    script = tmp_path / "ask.py"
    script.write_text(f"{guard}if __name__ == '__main__':\n    {code}\n")
    asking = subprocess.Popen([sys.executable, script])
    notes = [tmp_path / "0", tmp_path / "1"]
    wait_until(lambda: all(note.exists() and note.read_text() for note in notes))
    working = [int(note.read_text()) for note in notes]
    assert all(map(lives, working))
    asking.send_signal(how)
    asking.wait(SOON)
    wait_until(lambda: not any(map(lives, working)))
