# SPDX-License-Identifier: Apache-2.0
"""`check`: a description by itself, or beside a recording."""

from pathlib import Path

from touchline.check.findings import Findings
from touchline.check.model import check_model
from touchline.model.robot import load_robot


def check(robot: str | Path, log: str | Path | None = None) -> Findings:
    """Compare a description with its model and, if given, with a recording.

    Raises:
        InputError: the description or the log cannot be read.
    """
    model = load_robot(robot)
    findings = Findings()
    check_model(model, findings)
    if log is not None:
        from touchline.check.recording import check_recording

        check_recording(model, Path(log), findings)
    return findings
