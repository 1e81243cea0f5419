# SPDX-License-Identifier: Apache-2.0
"""`check`: a description by itself, or beside a recording."""

from pathlib import Path

from touchline.check.assumptions import check_assumptions
from touchline.check.felt import note_felt
from touchline.check.findings import Findings
from touchline.check.interface import check_interface
from touchline.check.model import check_model
from touchline.errors import InputError
from touchline.folder import check_file
from touchline.model.robot import load_robot
from touchline.model.robot_file import write_description
from touchline.model.yaml_file import read_yaml


def check(robot: str | Path, log: str | Path | None = None) -> Findings:
    """Compare a description with its model and, if given, with a recording.

    Raises:
        InputError: the description or the log cannot be read.
    """
    model = load_robot(robot)
    findings = Findings()
    check_assumptions(model, findings)
    check_model(model, findings)
    note_felt(model, findings)
    check_interface(model, findings)
    if log is not None:
        from touchline.check.recording import check_recording

        check_recording(model, Path(log), findings)
    return findings


def check_fix(out: Path) -> None:
    """Makes sure, before the work begins, that a corrected description can be written.

    Raises:
        InputError: it cannot.
    """
    if out.suffix not in (".yaml", ".yml"):
        raise InputError(f"--fix {out}: a robot description ends in .yaml")
    check_file(out, "--fix")


def write_fixes(robot: str | Path, found: Findings, out: Path) -> str:
    """Writes the description with what would mend findings; returns what was done.

    Raises:
        InputError: the file cannot be written, or there is none to start from.
    """
    source = load_robot(robot).description.path
    if source is None:
        raise InputError(f"--fix {out}: needs a robot.yaml to start from")
    if not found.fixes:
        return "nothing that could be mended by itself: nothing written"
    fixes = dict(found.fixes)
    if "joints" in fixes:  # those that a file does not name are not observed
        names = load_robot(robot).joint_names
        fixes["joints"] = {name: {} for name in names} | fixes["joints"]
    if "loads" in fixes:
        fixes["loads"] = [*(read_yaml(source).get("loads") or []), *fixes["loads"]]
    write_description(source, out, fixes)
    return f"written: {out}, with {', '.join(found.fixes)} mended"
