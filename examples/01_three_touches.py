# SPDX-License-Identifier: Apache-2.0
"""A simulated arm moves and is pushed at three places at once: where, and how hard?"""

import touchline as tl
from touchline.simulation.scenario import three_touches

robot = tl.load_robot("sara")
samples = three_touches(robot, speed=0.5).samples
pipeline = tl.Pipeline(robot)
pipeline.run(samples.time, samples.q, samples.qd, samples.tau, samples.wrench)
for event in pipeline.events:
    x, y, z = event.position
    where = f"{event.link} at ({x:+.3f}, {y:+.3f}, {z:+.3f}) m"
    print(f"{event.detected:.3f} s  {event.segment:6}  {event.force_peak:4.1f} N on {where}")
