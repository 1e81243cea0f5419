# SPDX-License-Identifier: Apache-2.0
"""`touchline demo` as a user starts it."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request

import pytest

from touchline.cli import main


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--duration", "-1"], "--duration"),
        (["--host", "203.0.113.7"], "203.0.113.7"),
        (["--port", "99999"], "99999"),
    ],
)
def test_what_cannot_be_is_refused_with_one_line(arguments, named, capsys):
    assert main(["demo", "--no-browser", *arguments]) == 2
    assert named in capsys.readouterr().err


def _may_be_interrupted():
    # Whoever runs the tests in the background has the signal ignored, and so have their children.
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.skipif(sys.platform == "win32", reason="no signals")
def test_the_page_is_served_until_it_is_interrupted():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-u", "-m", "touchline", "demo", "--no-browser", "--port", str(port)]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ,
        preexec_fn=_may_be_interrupted,  # noqa: PLW1509
    ) as demo:
        try:
            lines = []
            while not lines or "http://" not in lines[-1]:
                lines.append(demo.stdout.readline())
                assert lines[-1], "".join(lines)
            url = re.search(r"http://\S+", lines[-1]).group()
            assert url.startswith("http://127.0.0.1:")
            with urllib.request.urlopen(url, timeout=10) as answer:
                assert answer.status == 200 and b"<html" in answer.read()
            time.sleep(0.2)
            demo.send_signal(signal.SIGINT)
            rest, _ = demo.communicate(timeout=30)
            assert demo.returncode == 0 and "Traceback" not in rest
        finally:
            demo.kill()
