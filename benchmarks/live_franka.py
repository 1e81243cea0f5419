# SPDX-License-Identifier: Apache-2.0
"""A Franka arm over its own protocol, simulated by franky-sim: lost ticks, and pushes felt.

python benchmarks/live_franka.py PYTHON [SECONDS [FREE]]

PYTHON is the interpreter of an environment of its own with franky-sim 1.0.4; this one needs
touchline[franka]. First the arm moves freely for FREE seconds (default 60) and is calibrated on
that, since dry friction lies between the torques and the links. Then it moves in another way for
SECONDS (default 60) and is pushed with 20 N on a link every 3 s. What it left out on purpose and
what came is counted by the arm's clock.
"""

import json
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from touchline.cli.main import main as main_of_touchline
from touchline.live.connection import Connection
from touchline.live.session import Session
from touchline.live.sources import make_source
from touchline.model.robot import load_robot

PARTNER = Path(__file__).with_name("franka_partner.py")
HOST = "127.0.0.5"  # as in the partner
DRAIN = 0.3  # s in which what was sent last comes
MARGIN = 0.3  # s after a push in which it may still be felt


class Numbered(Session):
    """A session that keeps the samples' numbers."""

    numbers: list[int]

    def _take(self, sample) -> None:
        super()._take(sample)
        self.numbers.append(sample.sequence)


@dataclass
class Ride:
    """A session beside the partner, and what the partner says of it."""

    session: Numbered
    notices: list[str]
    truth: dict


def ride(python: str, seconds: float, folder: Path, robot: Path, seed: int, pushed: bool) -> Ride:
    """Lets the arm move for so long; `folder` gets the arm's description and `log.parquet`."""
    pipe = subprocess.PIPE
    command = [python, str(PARTNER), str(folder), str(seed), str(int(pushed))]
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as partner:
        assert partner.stdout is not None and partner.stdin is not None
        try:
            if partner.stdout.readline() != "ready\n":
                raise SystemExit("the partner did not start")
            arm = load_robot(str(robot))
            connection = Connection(make_source(f"franka://{HOST}", arm))
            with Numbered(arm, connection, folder / "log.parquet") as session:
                session.numbers = []
                session.start()
                notices, end = [], np.inf
                for _ in session.run():
                    if end == np.inf:
                        notices += [n.text for n in session.notices()]
                        if session.sample.time - session.origin > seconds:
                            end = time.monotonic() + DRAIN
                            partner.stdin.close()
                    if time.monotonic() > end:
                        break
        finally:
            partner.stdin.close()
        return Ride(session, notices, json.loads(partner.stdout.readline()))


def run(python: str, seconds: float, free: float) -> dict:
    """What came of it.

    Returns:
        `received` samples, `lost` as told, `missing` numbers between the first and the last,
        `left_out` of them by the partner and whether all these are `told`, `pushes`, those `felt`,
        `delays` [s], events `elsewhere` that no push explains, `late` ticks of the partner, and
        the first `notices`.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        robot = folder / "robot.yaml"
        if free > 0.0:
            ride(python, free, folder, robot, 1, False)
            log, robot = folder / "log.parquet", folder / "calibrated.yaml"
            command = ["calibrate", str(log), "--robot", str(folder / "robot.yaml")]
            if main_of_touchline([*command, "--trust", "--out", str(robot)]) != 0:
                raise SystemExit("the arm could not be calibrated")
        ridden = ride(python, seconds, folder, robot, 2, True)
    session, truth = ridden.session, ridden.truth
    events, lost = session.pipeline.events, session.connection.streams[0].lost
    numbers = np.array(session.numbers)
    missing = sorted(set(range(numbers[0], numbers[-1] + 1)) - set(numbers.tolist()))
    inside = {n for n in truth["left_out"] if numbers[0] <= n <= numbers[-1]}
    pushes = [p for p in truth["pushes"] if numbers[0] < p["begin"] < numbers[-1] - 500]
    delays, explained = [], set()
    for push in pushes:
        begin, end = push["begin"] * 1e-3, push["end"] * 1e-3 + MARGIN
        own = [e for e in events if begin <= e.detected <= end]
        explained |= {e.id for e in own}
        delays.append(min((e.detected - begin for e in own), default=np.nan))
    return {
        "received": len(numbers),
        "lost": lost,
        "missing": len(missing),
        "left_out": len(inside),
        "told": inside <= set(missing),
        "pushes": len(pushes),
        "felt": int(np.isfinite(delays).sum()),
        "delays": delays,
        "elsewhere": len([e for e in events if e.id not in explained]),
        "late": truth["late"],
        "notices": ridden.notices[:5],
    }


def main() -> None:
    """Prints the figures."""
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 60.0
    free = float(sys.argv[3]) if len(sys.argv) > 3 else 60.0
    f = run(sys.argv[1], seconds, free)
    print(f"{f['received']} states in {seconds:g} s, {f['late']} of the partner's ticks were late")
    print(
        f"{f['lost']} ticks told as lost, {f['missing']} missing by the arm's clock, "
        f"{f['left_out']} of them left out by the partner"
    )
    print(
        f"{f['felt']} of {f['pushes']} pushes of 20 N felt, after "
        f"{1e3 * np.nanmedian(f['delays']):.0f} ms (median); {f['elsewhere']} events elsewhere"
    )
    for text in f["notices"]:
        print(f"  {text}")


if __name__ == "__main__":
    main()
