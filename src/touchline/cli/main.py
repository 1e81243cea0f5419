# SPDX-License-Identifier: Apache-2.0
"""`touchline COMMAND`: finds the command, runs it, and turns errors into messages."""

import sys
from collections.abc import Sequence

from touchline.cli.analyze import analyze
from touchline.errors import InputError

COMMANDS = {"analyze": analyze}


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        argv: the arguments; default: those of the process.

    Returns:
        0 done, 1 failure, 2 bad input.
    """
    import tyro

    try:
        status = tyro.extras.subcommand_cli_from_dict(COMMANDS, prog="touchline", args=argv)
    except InputError as error:
        print(f"touchline: {error}", file=sys.stderr)
        return 2
    return int(status or 0)
