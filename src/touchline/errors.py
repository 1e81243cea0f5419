# SPDX-License-Identifier: Apache-2.0
"""Errors that are the user's to mend."""

from collections.abc import Iterable


class InputError(ValueError):
    """Input that cannot be used; the command line prints it and exits with status 2.

    Attributes:
        problems: every problem found, one clear line each.
    """

    def __init__(self, problems: str | Iterable[str]):
        self.problems = [problems] if isinstance(problems, str) else list(problems)
        super().__init__("\n".join(self.problems))
