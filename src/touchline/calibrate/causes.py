# SPDX-License-Identifier: Apache-2.0
"""Why a recording does not fit: what `check` finds wrong with its signals."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from touchline.calibrate.quiet import LISTED
from touchline.check.findings import COARSE, Findings, Kind
from touchline.check.recording import check_recording
from touchline.errors import InputError
from touchline.model.robot import Robot


@contextmanager
def causes_told(robot: Robot, logs: list[Path]) -> Iterator[None]:
    """Has a refusal go on with what `check` finds to be wrong with torques and sensors."""
    try:
        yield
    except InputError as error:
        told = [f"{log}: {line}" for log in logs for line in _causes(robot, log)]
        more = [f"... and {len(told) - LISTED} more (touchline check)"] * (len(told) > LISTED)
        raise InputError([*error.problems, *told[:LISTED], *more]) from None


def _causes(robot: Robot, log: Path) -> list[str]:
    found = Findings()
    check_recording(robot, log, found)
    return [finding.line for finding in found.of(*COARSE, Kind.GAIN)]
