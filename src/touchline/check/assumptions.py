# SPDX-License-Identifier: Apache-2.0
"""What was assumed of a robot, and what its model has that the method does not cover."""

from touchline.check.findings import Findings
from touchline.model.guess import cautions
from touchline.model.robot import Robot


def check_assumptions(robot: Robot, findings: Findings) -> None:
    """Add what was guessed and what the method does not cover; nothing measured is a finding."""
    if robot.assumed:
        findings.note(
            "assumed, as there is no robot.yaml (write one with `touchline init`)",
            *(f"  {statement}" for statement in robot.assumed),
        )
    findings.note("mind", *(f"  {line}" for line in cautions(robot.mechanism)))
    measured = [joint.name for joint in robot.description.joints if joint.measured]
    if not measured and not robot.description.sensors:
        findings.find(
            "nothing is measured: no joint has a torque signal and there is no force-torque "
            "sensor, so no touch can be felt"
        )
