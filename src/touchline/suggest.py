# SPDX-License-Identifier: Apache-2.0
"""Help with names that do not exist."""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any


def did_you_mean(word: Any, allowed: Iterable[str]) -> str:
    """Return ` (did you mean 'X'?)` for the closest allowed word, or nothing."""
    allowed = list(allowed)
    close = [name for name in allowed if name.lower() == str(word).lower()]
    close = close or get_close_matches(str(word), allowed, n=1)
    return f" (did you mean '{close[0]}'?)" if close else ""


def near_misses(word: Any, allowed: Iterable[str]) -> str:
    """Return ` Did you mean 'a.X', 'b.X' or 'Z'?` for at most three near names, or nothing.

    Names that have the word behind their last dot come first.
    """
    allowed, word = list(allowed), str(word)
    near = [name for name in allowed if name.rpartition(".")[2] == word]
    near += [name for name in get_close_matches(word, allowed, n=3) if name not in near]
    told = [f"'{name}'" for name in near[:3]]
    if not told:
        return ""
    return f" Did you mean {' or '.join(filter(None, (', '.join(told[:-1]), told[-1])))}?"


FEW = 4  # names in a line that need not have all of them


def listing(names: Iterable[str], limit: int = 60) -> str:
    """Return the names, comma separated, of many only the first."""
    names = list(names)
    more = f", ... ({len(names) - limit} more)" if len(names) > limit else ""
    return (", ".join(names[:limit]) or "none") + more


def not_allowed(word: Any, allowed: Iterable[str]) -> str:
    """Return `'word' is not allowed; allowed: a, b, c (did you mean 'a'?)`."""
    allowed = list(allowed)
    return f"'{word}' is not allowed; allowed: {', '.join(allowed)}{did_you_mean(word, allowed)}"


def unknown(word: Any, kind: str, known: Iterable[str]) -> str:
    """Return `unknown KIND 'word'; known: a, b, c (did you mean 'a'?)`."""
    known = list(known)
    return f"unknown {kind} '{word}'; known: {listing(known, 20)}{did_you_mean(word, known)}"
