# SPDX-License-Identifier: Apache-2.0
"""`touchline COMMAND`: finds the command, runs it, and turns errors into messages."""

import sys
from collections.abc import Callable, Sequence

from touchline import __version__
from touchline.cli.analyze import analyze
from touchline.cli.bench import bench
from touchline.cli.calibrate import calibrate
from touchline.cli.check import check
from touchline.cli.demo import demo
from touchline.cli.reproduce import reproduce
from touchline.cli.simulate import simulate
from touchline.cli.view import view
from touchline.errors import InputError
from touchline.suggest import did_you_mean

USAGE = """\
The sense of touch for a robot arm without a skin: external wrenches and contacts from
joint-torque and force-torque sensors.

usage: touchline COMMAND ...

{commands}

`touchline COMMAND --help` explains a command; `touchline --version` names the version.
Exit status: 0 done, 1 failure (check: findings), 2 bad input."""

COMMANDS: dict[str, Callable[..., int]] = {
    "demo": demo,
    "simulate": simulate,
    "analyze": analyze,
    "view": view,
    "check": check,
    "calibrate": calibrate,
    "reproduce": reproduce,
    "bench": bench,
}

EXTRAS = {
    "pyarrow": "logs",
    "rosbags": "logs",
    "collada": "meshes",
    "matplotlib": "report",
    "viser": "view",
    "websockets": "view",
    "pinocchio": "bench",
    "idyntree": "bench",
    "example_robot_data": "bench",
}
INTERRUPTED = 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        argv: the arguments; default: those of the process.

    Returns:
        0 done, 1 failure (`check`: findings), 2 bad input, with a message on stderr.
    """
    try:
        return _dispatch(list(sys.argv[1:] if argv is None else argv))
    except InputError as error:
        return _complain(str(error), 2)
    except ModuleNotFoundError as error:
        extra = EXTRAS.get((error.name or "").partition(".")[0])
        if extra is None:
            raise
        return _complain(f"{error.name} is not installed: pip install 'touchline[{extra}]'", 1)
    except KeyboardInterrupt:
        return _complain("stopped", INTERRUPTED)
    except BrokenPipeError:  # the reader of our output has seen enough
        sys.stdout = None
        return 0


def _dispatch(arguments: list[str]) -> int:
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print(_usage())
        return 0
    name, rest = arguments[0], arguments[1:]
    if name == "--version":
        print(f"touchline {__version__}")
        return 0
    if name not in COMMANDS:
        raise InputError(
            f"unknown command '{name}'; there are: {', '.join(COMMANDS)}"
            f"{did_you_mean(name, COMMANDS)}"
        )
    return _run(name, rest)


def _run(name: str, arguments: list[str]) -> int:
    import tyro

    try:
        return int(tyro.cli(COMMANDS[name], prog=f"touchline {name}", args=arguments))
    except SystemExit as stop:  # help, or arguments that cannot be understood
        return stop.code if isinstance(stop.code, int) else 2


def _usage() -> str:
    lines = []
    for name, command in COMMANDS.items():
        text = (command.__doc__ or "").splitlines()
        lines += [f"  {name:10}{text[0]}", f"{'':12}{_example(text)}"]
    return USAGE.format(commands="\n".join(lines))


def _example(lines: list[str]) -> str:
    return next((line.strip() for line in lines if line.strip().startswith("Example:")), "")


def _complain(message: str, status: int) -> int:
    print(f"touchline: {message}", file=sys.stderr)
    return status
