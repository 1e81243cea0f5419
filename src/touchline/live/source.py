# SPDX-License-Identifier: Apache-2.0
"""What every kind of running robot offers, and the addresses by which they are named."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable
from urllib.parse import parse_qsl, unquote, urlsplit

from touchline.errors import InputError
from touchline.live.sample import Sample
from touchline.live.streams import Stream
from touchline.pipeline.pipeline import Pipeline
from touchline.suggest import did_you_mean, unknown


class LinkLost(Exception):
    """The peer does not answer any more; `open` may be tried again."""


class EndOfSource(Exception):
    """There are no more samples, and there will be none."""


class Source(Protocol):
    """A robot that reports samples.

    Attributes:
        name: its address, for messages.
        streams: what arrives; the first is the one that makes the samples.
        period: between samples [s] where it is known beforehand, else None.
    """

    name: str
    streams: tuple[Stream, ...]
    period: float | None

    def open(self) -> list[str]:
        """Connects; may be called again after `LinkLost`. Commands nothing.

        Returns:
            What the user should know of what is read, one line each.

        Raises:
            InputError: the peer can never be read in this way.
            LinkLost: nobody answers now.
        """
        ...

    def read(self, timeout: float) -> list[Sample]:
        """The samples that have come, after waiting at most so long [s] for the first.

        Raises:
            LinkLost: the connection has broken.
            EndOfSource: there are no more samples.
        """
        ...

    def close(self) -> None:
        """Disconnects."""
        ...


@runtime_checkable
class NativeSource(Protocol):
    """A source that can be read and felt in native threads, whatever Python does."""

    def attach(self, pipeline: Pipeline) -> None:
        """From now on `read` hands out samples that the pipeline has taken, with its results."""
        ...


@dataclass(frozen=True)
class Address:
    """`SCHEME://PLACE?KEY=VALUE&...`.

    Attributes:
        text: as given.
        scheme: kind of source.
        place: host with port, path or name; may be empty.
        options: keys and values behind the question mark.
    """

    text: str
    scheme: str
    place: str
    options: Mapping[str, str] = field(default_factory=dict)

    def only(self, *allowed: str) -> None:
        """Checks the options.

        Raises:
            InputError: one is not allowed.
        """
        for name in self.options:
            if name not in allowed:
                raise InputError(f"{self.text}: {unknown(name, 'option', allowed)}")

    def number(self, name: str, default: float, least: float = 0.0) -> float:
        """An option that is a finite number of at least `least`.

        Raises:
            InputError: it is none.
        """
        word = self.options.get(name)
        if word is None:
            return default
        try:
            value = float(word)
        except ValueError:
            value = float("nan")
        if not least <= value < float("inf"):
            raise InputError(f"{self.text}: {name}={word}: must be a number of at least {least:g}")
        return value

    def host(self, port: int) -> tuple[str, int]:
        """Host and port; `port` where none is given.

        Raises:
            InputError: the host is missing or the port is no port.
        """
        try:
            parts = urlsplit(f"//{self.place}")
            found = parts.port if parts.port is not None else port
        except ValueError as error:
            raise InputError(f"{self.text}: {error}") from None
        if not parts.hostname or parts.path or found == 0:
            raise InputError(f"{self.text}: expected {self.scheme}://HOST or HOST:PORT")
        return parts.hostname, found


def parse_address(text: str, schemes: Mapping[str, str]) -> Address:
    """Reads the address of a source.

    Args:
        text: as given by the user.
        schemes: scheme -> how its addresses look, for messages.

    Raises:
        InputError: it is of no known kind.
    """
    scheme, mark, rest = text.partition("://")
    if not mark or scheme not in schemes:
        known = ", ".join(schemes.values())
        raise InputError(f"--source {text}: expected one of {known}{did_you_mean(scheme, schemes)}")
    place, _, query = rest.partition("?")
    pairs = parse_qsl(query, keep_blank_values=True)
    return Address(text, scheme, unquote(place).rstrip("/") if place != "/" else place, dict(pairs))
