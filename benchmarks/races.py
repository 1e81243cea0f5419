# SPDX-License-Identifier: Apache-2.0
"""Two threads on one object, again and again: `races.py [RACES]`, 1,000 without it.

A process of its own runs each hundred of them, so that an abort is counted and ends nothing else.
Prints races, aborts and exceptions that are not in words.
"""

import subprocess
import sys
import threading

import numpy as np

import touchline as tl
from touchline.detector.detector import Detector
from touchline.errors import InputError
from touchline.simulation.scenario import three_touches

PART = 100


def calls(shared, signals, rng):
    """What one of the threads does."""
    few = tuple(x[:60] for x in signals)
    begin = int(rng.integers(0, 200))
    part = tuple(x[begin : begin + 50] for x in signals)
    choices = [
        lambda: shared.run(*part),
        lambda: [shared.update(*s) for s in zip(*few, strict=True)],
    ]
    if not isinstance(shared, Detector):
        choices.append(shared.reset)
    if isinstance(shared, tl.Pipeline):
        choices += [lambda: repr(shared.events), lambda: shared.resets, shared.tare]
    return choices[int(rng.integers(len(choices)))]


def race(make, signals, seed):
    """Exceptions that are not in words."""
    shared, begin, found = make(), threading.Barrier(2), []

    def work(number):
        rng = np.random.default_rng([seed, number])
        begin.wait()
        for _ in range(3):
            try:
                calls(shared, signals, rng)()
            except (InputError, ValueError):
                pass
            except Exception as error:  # whatever it is: that is what is counted
                found.append(repr(error))

    threads = [threading.Thread(target=work, args=(i,)) for i in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found


def part(first, count):
    """Races of numbers `first` to `first + count - 1`."""
    robot = tl.load_robot("sara")
    s = three_touches(robot, speed=0.5, seconds=0.3).samples
    signals = (s.time, s.q, s.qd, s.tau, s.wrench)
    makes = (lambda: tl.Pipeline(robot), lambda: tl.Observer(robot))
    makes += (lambda: Detector(tl.Observer(robot)),)
    found = [e for i in range(first, first + count) for e in race(makes[i % 3], signals, i)]
    print(len(found), *found[:3], sep="\n")


def main(races):
    """Prints what came of them."""
    aborts = exceptions = 0
    for first in range(0, races, PART):
        count = min(PART, races - first)
        command = [sys.executable, __file__, "--part", str(first), str(count)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            aborts += 1
            print(f"races from {first} on: status {done.returncode}, {done.stderr[-300:]}")
        else:
            number, *words = done.stdout.splitlines()
            exceptions += int(number)
            print(*words, sep="\n", end="\n" * bool(words))
    print(f"{races} races: {aborts} aborts, {exceptions} exceptions that are not in words")
    return int(aborts + exceptions > 0)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--part"]:
        part(int(sys.argv[2]), int(sys.argv[3]))
    else:
        sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000))
