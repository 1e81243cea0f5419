# SPDX-License-Identifier: Apache-2.0
"""Programs compiled against the headers alone."""

import os
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
COMPILER = shutil.which("g++") or shutil.which("c++")
# Checks are the same without the optimizer, which takes most of the time to compile them.
SANITIZED = ("-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
THREADED = ("-O0", "-fsanitize=thread")
FLAGS = ("-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-ffp-contract=off")


def compile_program(source, target, *flags):
    """Compiles one file against the headers; returns what the compiler said of an error."""
    command = [COMPILER, *FLAGS, *flags, f"-I{ROOT / 'core' / 'include'}", source, "-o", target]
    return subprocess.run(
        [str(part) for part in command], check=False, capture_output=True, text=True
    ).stderr


def run_program(program, *arguments):
    under = os.environ.get("RUN_UNDER", "").split()  # `make valgrind`
    return subprocess.run(
        [*under, str(program), *map(str, arguments)], capture_output=True, text=True, check=True
    )
