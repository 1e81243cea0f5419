# SPDX-License-Identifier: Apache-2.0
"""`touchline calibrate`."""

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from touchline.cli.described import described

Method = Literal["rows", "scaled", "chi2", "glrt", "cusum"]


def calibrate(
    logs: Annotated[Positional[tuple[Path, ...]], arg(metavar="LOG [LOG ...]")] = (),
    /,
    robot: Annotated[str | None, arg(metavar="ROBOT")] = None,
    out: Annotated[Path | None, arg(metavar="ROBOT")] = None,
    plan: Annotated[str | None, arg(metavar="ROBOT")] = None,
    method: Annotated[tuple[Method, ...], arg(metavar="METHOD [METHOD ...]")] = (),
    false_alarms: Annotated[float | None, arg(metavar="PER_HOUR")] = None,
    trust: bool = False,
    identify: bool = True,
    learn: bool = False,
    gains: bool = False,
    figure: Annotated[Path | None, arg(metavar="FILE")] = None,
    pictures: Annotated[Path | None, arg(metavar="DIR")] = None,
) -> int:
    """Identifies what a robot's model lacks, its noise figures and its detection thresholds.

    Example: touchline calibrate free1.parquet free2.parquet --robot robot.yaml --out robot.yaml

    Move the robot as it will move at work, touch nothing, and record: a minute tells friction and
    inertias, half an hour thresholds. Finds offsets of joints and sensors, friction, rotor inertias
    (torque: motor) and inertias, each as far as the data show it. It prints the residuals before
    and after on held-out data, and writes only what is better there. Noise and thresholds follow;
    these hold for the sample rate of the recordings. All other keys and comments stay.

    Stretches in which something seems to touch the robot are left out and listed. Where most of a
    recording seems touched it is refused, with the row that stands out. So is one in which a force
    rests on the arm throughout, with its size and link.

    With --plan ROBOT it proposes a motion of a minute instead, and predicts what that will
    identify. The motion keeps the limits of joints, speeds and torques, and the arm's links do not
    meet. It writes the motion into the folder --out: as a table, as a JointTrajectory (YAML, JSON)
    and as Python lists; for an arm with force-torque sensors also poses to rest in.
    Example: touchline calibrate --plan robot.yaml --out motion

    Args:
        logs: Recordings of contact-free motion: tables (.parquet, .csv, .csv.gz) or rosbag2.
        robot: A robot.yaml, a URDF or MJCF, or the name of a robot.
        out: The new robot.yaml; may be the same file. With --plan: a folder.
        plan: A robot that needs a motion to be identified by; it takes the place of LOG.
        method: Method of detection: rows (a threshold per row), scaled (which grows with speed and
            acceleration), chi2 (all rows of a segment together), glrt (of several windows of the
            unfiltered loads; quick), cusum (of innovations; quick). Several may be named; an event
            begins when one of them fires. Default: as described.
        false_alarms: False alarms per hour of the whole robot. Default: as described, or 1.
        trust: Nothing touched the robot: what stands out is friction or the like, and counts.
        identify: Whether biases, friction and inertias are identified; if not, only noise and
            thresholds are.
        learn: Learns what physics leaves of each joint's torque, as a table over the joint's own
            position and velocity, beside the robot.yaml (NAME_rest.csv). A joint gets one only
            where that helps in time and space it has not seen. Off where nothing was seen.
        gains: Identifies the gains of motor currents (torque: motor) as well. Describe all loads
            first: gains and masses scale together. Only a force-torque sensor that weighs the arm
            tells them apart.
        figure: Draws how often which statistic was exceeded, with the thresholds (.svg, .png).
        pictures: Draws residuals before and after, and friction over speed, into this folder.
    """
    from touchline.errors import InputError

    if plan is not None:
        beside = {"LOG": logs, "--robot": robot, "--method": method, "--trust": trust}
        beside |= {"--false-alarms": false_alarms, "--no-identify": not identify, "--learn": learn}
        beside |= {"--gains": gains, "--figure": figure, "--pictures": pictures}
        if any(beside.values()):
            given = ", ".join(name for name, value in beside.items() if value)
            raise InputError(f"--plan {plan}: proposes a motion and reads none: leave {given} out")
        return _plan(plan, out or Path("motion"))
    if robot is None or out is None:
        raise InputError("calibrate: --robot and --out are needed, or --plan ROBOT")
    from touchline.calibrate.run import calibrate as run
    from touchline.calibrate.summary import summary_text

    if figure is not None:
        from touchline.calibrate.figure import check_figure

        check_figure(figure)
    if pictures is not None:
        from touchline.folder import make_folder

        if not identify:
            raise InputError("--pictures: draws what was identified: leave --no-identify out")
        make_folder(pictures)
    with described(robot, logs[0] if logs else None, out) as source:
        result = run(list(logs), source, out, method, false_alarms, trust, identify, learn, gains)
    print(summary_text(result))
    if figure is not None:
        from touchline.calibrate.figure import draw_calibration

        draw_calibration(result, figure)
        print(f"drawn:   {figure}")
    if pictures is not None and result.identification is not None:
        from touchline.calibrate.pictures import draw_identification

        drawn = draw_identification(result.identification, pictures)
        print(f"drawn:   {', '.join(str(path) for path in drawn)}")
    return 0


def _plan(robot: str, folder: Path) -> int:
    from touchline.calibrate.plan import make_plan, write_plan
    from touchline.folder import make_folder
    from touchline.model.robot import load_robot

    model = load_robot(robot)
    make_folder(folder)  # before the search, which takes a minute
    plan = make_plan(model)
    written = write_plan(plan, folder)
    print(plan.text())
    print("\nwritten: " + ", ".join(str(path) for path in written))
    return 0
