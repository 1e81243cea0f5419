# SPDX-License-Identifier: Apache-2.0
"""`touchline COMMAND`: finds the command, runs it, and turns errors into messages."""

import contextlib
import functools
import inspect
import io
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from itertools import takewhile
from typing import Any

from touchline import __version__
from touchline.cli.analyze import analyze
from touchline.cli.bench import BENCHMARKS, bench
from touchline.cli.calibrate import calibrate
from touchline.cli.check import check
from touchline.cli.demo import demo
from touchline.cli.explained import for_help
from touchline.cli.export import export
from touchline.cli.init import init
from touchline.cli.label import label
from touchline.cli.live import live
from touchline.cli.reproduce import reproduce
from touchline.cli.simulate import simulate
from touchline.cli.teach import teach
from touchline.cli.view import view
from touchline.errors import InputError
from touchline.extras import missing
from touchline.suggest import did_you_mean

USAGE = """\
The sense of touch for a robot arm without a skin: external wrenches and contacts from
joint-torque and force-torque sensors.

usage: touchline COMMAND ...

{commands}

`touchline COMMAND --help` explains a command; `touchline --version` names the version.
Exit status: 0 done, 1 failure (check: findings), 2 bad input, 3 done in part (many recordings)."""

COMMANDS: dict[str, Callable[..., int]] = {
    "demo": demo,
    "init": init,
    "simulate": simulate,
    "analyze": analyze,
    "label": label,
    "view": view,
    "live": live,
    "check": check,
    "calibrate": calibrate,
    "export": export,
    "teach": teach,
    "reproduce": reproduce,
    "bench": bench,
}

BENCH_USAGE = """\
{text}

usage: touchline bench [NAME] [OPTIONS], or several names; without a name: all of them

{commands}

`touchline bench NAME --help` explains one and its options."""

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
        told = missing(error.name or "")
        if told is None:
            raise
        return _complain(told, 1)
    except KeyboardInterrupt:
        return _complain("stopped", INTERRUPTED)
    except BrokenPipeError:  # the reader of our output has seen enough
        sys.stdout = None
        return 0
    except MemoryError as error:
        return _complain(f"not enough memory: {error}", 1)
    except OSError as error:  # no room, no permission, a name that no file can have
        if error.filename is None:
            return _complain(str(error), 1)
        return _complain(f"{error.filename}: {error.strerror}", 2)


def _dispatch(arguments: list[str]) -> int:
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print(_usage())
        return 0
    if arguments[0] == "--version":
        print(f"touchline {__version__}")
        return 0
    return int(understood(arguments)())


def understood(arguments: list[str]) -> Callable[[], int]:
    """The call that a command line asks for; help that it asks for is printed.

    Args:
        arguments: the command and what follows it.

    Raises:
        InputError: there is no such command, or it has no such arguments.
    """
    name, rest = arguments[0], arguments[1:]
    _check_name("command", name, COMMANDS)
    return _bench(rest) if name == "bench" else _parsed(COMMANDS[name], name, rest)


def _bench(arguments: list[str]) -> Callable[[], int]:
    names = list(takewhile(lambda word: not word.startswith("-"), arguments))
    options = arguments[len(names) :]
    for name in names:
        _check_name("benchmark", name, BENCHMARKS)
    if not names and options in (["-h"], ["--help"]):
        text = inspect.cleandoc(bench.__doc__ or "")
        print(BENCH_USAGE.format(text=text, commands=_listing(BENCHMARKS, 16)))
        return lambda: 0
    if options and len(names) != 1:
        raise InputError(f"{options[0]}: options belong to one benchmark: touchline bench NAME ...")
    if not names:
        return bench
    calls = [_parsed(BENCHMARKS[name], f"bench {name}", options) for name in names]
    return lambda: max([int(call()) for call in calls])


def _check_name(kind: str, name: str, known: Iterable[str]) -> None:
    if name not in known:
        raise InputError(
            f"unknown {kind} '{name}'; there are: {', '.join(known)}{did_you_mean(name, known)}"
        )


def _parsed(command: Callable[..., int], name: str, arguments: list[str]) -> Callable[[], int]:
    """A command with its arguments; those that cannot be understood are told in one line."""
    import tyro

    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return tyro.cli(_deferred(for_help(command)), prog=f"touchline {name}", args=arguments)
    except SystemExit as stop:  # help, or arguments that cannot be understood
        if stop.code:
            raise InputError(_in_one_line(said.getvalue(), name)) from None
        return lambda: 0


def _deferred(command: Callable[..., int]) -> Callable[..., Callable[[], int]]:
    """The same command, which is not run yet: it gives the call with all its arguments."""

    @functools.wraps(command)
    def taken(*given: Any, **options: Any) -> Callable[[], int]:
        return functools.partial(command, *given, **options)

    return taken


def _in_one_line(box: str, name: str) -> str:
    """What a box of tyro says, without its frame: parts between its rules, joined by semicolons."""
    parts: list[list[str]] = [[]]
    for line in box.splitlines():
        words = line.strip("\u2502 ")
        if not words or words[0] in "\u256d\u2570":
            continue
        if words.strip("-") == "" and len(parts) == 1:  # where a terminal has no lines: its title
            parts = [[], []]
        elif words.strip("-\u2500") == "":
            parts.append([])
        else:
            parts[-1].append(words)
    said = [" ".join(part) for part in parts if part and not part[0].startswith("For full")]
    plain = [number for words in said if (number := _no_number(words))]
    told = plain or [words.replace(" (required)", "").rstrip(".") for words in said]
    return f"{'; '.join(told) or 'arguments missing'}; see touchline {name} --help"


def _no_number(words: str) -> str | None:
    """What is wrong with a value that is no number, from what tyro says of it."""
    quoted = r"""('[^']*'|"[^"]*")"""
    found = re.match(rf"Error parsing ([^:]+): .*(base 10|to float): {quoted}", words)
    if found is None:
        return None
    option, how, value = found.groups()
    return f"{option} takes a {'whole ' if how == 'base 10' else ''}number, not {value}"


def _usage() -> str:
    return USAGE.format(commands=_listing(COMMANDS, 10))


def _listing(commands: dict[str, Callable[..., int]], width: int) -> str:
    lines = []
    for name, command in commands.items():
        text = (command.__doc__ or "").splitlines()
        lines += [f"  {name:{width}}{text[0]}", f"{'':{width + 2}}{_example(text)}"]
    return "\n".join(lines)


def _example(lines: list[str]) -> str:
    return next((line.strip() for line in lines if line.strip().startswith("Example:")), "")


def _complain(message: str, status: int) -> int:
    print(f"touchline: {message}", file=sys.stderr)
    return status
