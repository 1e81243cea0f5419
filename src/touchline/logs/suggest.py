# SPDX-License-Identifier: Apache-2.0
"""Words for messages: what was probably meant, and what there is."""

from collections.abc import Iterable
from difflib import get_close_matches


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """`; did you mean X?`, or nothing where no known name is close."""
    known = list(known)
    close = [word for word in known if word.lower() == name.lower()]
    close = close or get_close_matches(name, known, n=1, cutoff=0.7)
    return f"; did you mean {close[0]!r}?" if close else ""


def listing(names: Iterable[str], limit: int = 60) -> str:
    """The names, comma separated, cut off after `limit`."""
    names = list(names)
    more = f", ... ({len(names) - limit} more)" if len(names) > limit else ""
    return (", ".join(names[:limit]) or "none") + more


def unknown(kind: str, name: str, allowed: Iterable[str]) -> str:
    """An unknown name, with what is allowed."""
    allowed = list(allowed)
    return f"unknown {kind} {name!r}; allowed: {listing(allowed)}{did_you_mean(name, allowed)}"
