# SPDX-License-Identifier: Apache-2.0
"""Touchline in a control loop: one sample in, contacts and health out."""

import touchline as tl
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import base_touch
from touchline.simulation.scene import Run

robot = tl.load_robot("sara")
samples = base_touch(robot, settings=Run(noise=SensorNoise())).samples  # your robot's signals
pipeline = tl.Pipeline(robot)

for time, q, qd, tau, wrench in zip(
    samples.time, samples.q, samples.qd, samples.tau, samples.wrench, strict=True
):
    result = pipeline.update(time, q, qd, tau, wrench)  # never raises on a bad sample
    if result.health & tl.Health.SENSOR_EXCLUDED:
        print(f"{time:.3f} s  a sensor is missing")
    for contact in result.contacts:
        if contact.status == "located" and round(1000 * time) % 100 == 0:
            print(
                f"{time:.3f} s  {contact.link}: {contact.force.round(1)} N, "
                f"point known to {1e3 * contact.position_std:.2f} mm"
            )
