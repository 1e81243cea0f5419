# SPDX-License-Identifier: Apache-2.0
"""Programs compiled against the headers alone."""

import os
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
COMPILER = shutil.which("g++") or shutil.which("c++")
# Checks are the same without the optimizer, which takes most of the time to compile them.
SANITIZED = ("-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
THREADED = ("-O0", "-fsanitize=thread")
PLAIN = ("-O2",)
FLAGS = ("-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-ffp-contract=off")
BROADCASTER = ROOT / "ros" / "touchline_broadcaster"
INCLUDES = (ROOT / "core" / "include", HERE / "ros_signatures", BROADCASTER / "include")


def compile_program(source, target, *flags):
    """Compiles one file against the headers; returns what the compiler said of an error."""
    includes = [f"-I{folder}" for folder in INCLUDES]
    command = [COMPILER, *FLAGS, *flags, *includes, source, "-o", target]
    return subprocess.run(
        [str(part) for part in command], check=False, capture_output=True, text=True
    ).stderr


def run_program(program, *arguments):
    under = os.environ.get("RUN_UNDER", "").split()  # `make valgrind`
    return subprocess.run(
        [*under, str(program), *map(str, arguments)], capture_output=True, text=True, check=True
    )
