# SPDX-License-Identifier: Apache-2.0
"""How many small mistakes in the kernel would be noticed: `mutants.py [COUNT [SEED]]`, 40 without.

Each mutant of the observer's headers has one operator, comparison or number changed. A program with
120 recordings of random robots with faults (tests/core/side_by_side.cpp) runs on it. Its sums must
differ from those of the kernel as it is, which the tests compare with Pinocchio; or the two ways of
running it must. What does not compile is no mutant. Prints the survivors, with line, and the score.
A survivor may change nothing that can be seen, so the score is a lower bound.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
HEADERS = ROOT / "core" / "include"
KERNEL = (
    *(f"detail/observer/{name}.hpp" for name in ("balance", "filter", "row", "projections")),
    *(f"detail/observer/{name}.hpp" for name in ("terms", "observer", "channels", "clock")),
    *(f"detail/observer/{name}.hpp" for name in ("readings", "layout", "side_by_side")),
    *(f"detail/model/{name}.hpp" for name in ("tree", "spatial")),
)
CHANGES = (
    (r" \+ ", " - "),
    (r" - ", " + "),
    (r" \* ", " / "),
    (r" \+= ", " -= "),
    (r" < ", " >= "),
    (r" > ", " <= "),
    (r" == ", " != "),
    (r" && ", " || "),
    (r"\b0\.5\b", "0.6"),
    (r"\b1\.0\b", "1.1"),
    (r"\b2\.0\b", "2.1"),
    (r"cross\((\w+(?:\.\w+)?), ", r"cross(-1.0 * \1, "),
)
LONGEST = 60.0  # s that a mutant may run


def places():
    """File, line and change of all that can be mutated."""
    for name in KERNEL:
        lines = (HEADERS / "touchline" / name).read_text().splitlines()
        for number, line in enumerate(lines):
            code = line.split("//")[0]
            if code.lstrip().startswith(
                ("#", "template", "static_assert", "throw", "if constexpr")
            ):
                continue
            for pattern, new in CHANGES:
                for match in re.finditer(pattern, code):
                    yield name, number, match.start(), match.end(), match.expand(new)


def build(include, program):
    """Whether the program compiles against these headers."""
    source = ROOT / "tests" / "core" / "side_by_side.cpp"
    flags = ["-std=c++17", "-O1", "-w", "-ffp-contract=off", f"-I{include}"]
    command = ["g++", *flags, str(source), "-o", str(program)]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def sums(program):
    """What it prints as numbers; the last one: how many differ. None: it fails or hangs."""
    try:
        done = subprocess.run(
            [str(program), "sums"], capture_output=True, text=True, check=False, timeout=LONGEST
        )
    except subprocess.TimeoutExpired:
        return None
    if done.returncode != 0:
        return None
    return np.array([float(line.split()[0]) for line in done.stdout.splitlines()])


def alike(found, right):
    """Are these the same sums?"""
    return found.shape == right.shape and np.allclose(found, right, rtol=1e-9, atol=1e-9)


def main(count, seed):
    """Prints survivors and the score."""
    from tqdm import tqdm

    rng, all_places = np.random.default_rng(seed), list(places())
    with tempfile.TemporaryDirectory() as folder:
        program, include = Path(folder) / "program", Path(folder) / "include"
        if not build(HEADERS, program):
            raise SystemExit("the kernel does not compile")
        right = sums(program)
        if right is None or right[-1] != 0.0:
            raise SystemExit("the kernel as it is fails")
        shutil.copytree(HEADERS, include)
        valid = killed = 0
        drawn = rng.permutation(len(all_places))[:count]
        for at in tqdm(drawn, desc="mutants", disable=None, leave=False):
            name, number, begin, end, new = all_places[at]
            path = include / "touchline" / name
            text = path.read_text()
            lines = text.splitlines(keepends=True)
            lines[number] = lines[number][:begin] + new + lines[number][end:]
            path.write_text("".join(lines))
            if build(include, program):
                valid += 1
                found = sums(program)
                if found is not None and found[-1] == 0.0 and alike(found, right):
                    print(f"{name}:{number + 1}: {lines[number].strip()}")
                else:
                    killed += 1
            path.write_text(text)
    score = 100 * killed / max(valid, 1)
    print(f"{valid} mutants of {len(all_places)} places: {killed} noticed, {score:.0f} %")
    return int(killed < 0.8 * valid)


if __name__ == "__main__":
    sys.exit(main(*(int(word) for word in (sys.argv[1:] + ["40", "0"][len(sys.argv) - 1 :]))))
