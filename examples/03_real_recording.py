# SPDX-License-Identifier: Apache-2.0
"""A recording of a real Panda, touched by a person: from a CSV file to events.

Usage: python examples/03_real_recording.py [LOG.csv.gz]
"""

import sys
from pathlib import Path

import touchline as tl
from touchline.logs import read_log

here = Path(__file__).parent
default = here.parents[1] / "shared" / "data" / "panda_touches" / "c2.csv.gz"
log = Path(sys.argv[1]) if len(sys.argv) > 1 else default
if not log.exists():
    sys.exit(f"{log}: no such recording; give one of a Panda as argument")

robot = tl.load_robot(here / "robots" / "panda_hand.yaml")
samples = read_log(log, robot.description)
pipeline = tl.Pipeline(robot, period=0.005)
pipeline.run(samples.time, samples.q, samples.qd, samples.tau)
for event in pipeline.events:
    print(f"{event.detected:6.2f} s  {event.level}, last loaded joint {event.joint}")
    for candidate in event.candidates[:3]:
        print(f"          {100 * candidate.probability:3.0f} %  {candidate.link}")
