# SPDX-License-Identifier: Apache-2.0
"""`touchline check`."""

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from touchline.cli.described import described


def check(
    robot: Annotated[Positional[str], arg(metavar="ROBOT")],
    log: Annotated[Positional[Path | None], arg(metavar="[LOG]")] = None,
    /,
    fix: Annotated[Path | None, arg(metavar="ROBOT")] = None,
) -> int:
    """Tells whether a robot description is consistent with itself and with a recording of it.

    Example: touchline check robot.yaml run1.parquet

    Without LOG it shows what the model says: masses, what each sensor carries, segments, bodies,
    which sensor faults the layout cannot see, and the smallest force that is felt on each link.
    Where there is no robot.yaml it lists what is assumed. With LOG it compares: signs, polarity,
    frames, units, biases, weights outboard of the sensors, dead signals, sample rate, gaps and
    stamps. A recording in which the robot rests in several poses and touches nothing tells most.

    Exit status: 0 nothing found, 1 findings, 2 bad input.

    Args:
        robot: A robot.yaml, a URDF or MJCF, or the name of a robot.
        log: A recording: a table (.parquet, .csv, .csv.gz) or a rosbag2 (.mcap, .db3).
        fix: Writes a copy of the description in which all is mended that has a key there: loads, a
            tilted base, sign, gain, offset, delay and compensation of torques; polarity, axes and
            bias of force-torque sensors; noise figures; the order of joints' columns in the log.
            The log's units are left to you.
    """
    from touchline.check.run import check as run

    if fix is not None:
        from touchline.check.run import check_fix

        check_fix(fix)
    result = run(robot, log)
    print(result.text())
    if fix is not None:
        from touchline.check.run import write_fixes

        with described(robot, log, fix) as source:
            print("\n" + write_fixes(source, result, fix))
    return 1 if result.findings else 0
