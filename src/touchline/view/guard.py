# SPDX-License-Identifier: Apache-2.0
"""Who may talk to the page's server.

A browser lets any page that is open in it send requests to 127.0.0.1. Such a page gives itself away
by its origin, or, if its own name was made to point to 127.0.0.1 (DNS rebinding), by the host that
it asks for. Programs on this machine send no origin and are welcome.
"""

import hmac
import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from typing import Protocol
from urllib.parse import parse_qs, urlsplit

LOCAL_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})
COOKIE = "touchline-token"

# The page is one file with everything in it; it may load nothing from elsewhere, and no other page
# may show it in a frame, where clicks could be stolen.
PAGE_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' data: blob:; "
        "frame-ancestors 'none'; form-action 'none'; base-uri 'none'"
    ),
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class Headers(Protocol):
    """Headers of a request, of which one may come several times."""

    def get_all(self, key: str) -> list[str]:
        """All values of a header."""
        ...


def is_local(host: str) -> bool:
    """Whether an address to listen at is reached from this machine alone."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


@dataclass(frozen=True)
class Guard:
    """Judges requests before they are answered.

    Attributes:
        hosts: names under which the server may be asked for, lower case, without port.
        token: that has to be shown, in the address or by the cookie it is answered with; "" for a
            server that only this machine reaches.
    """

    hosts: frozenset[str] = LOCAL_NAMES
    token: str = ""

    def refusal(self, path: str, headers: Headers, own_address: str = "") -> str | None:
        """Why a request is refused; None if it is welcome.

        Args:
            path: asked for, with the query.
            headers: of the request.
            own_address: to which the connection was made, which is a name of the server as well.
        """
        asked, origins = headers.get_all("Host"), headers.get_all("Origin")
        if len(asked) != 1 or len(origins) > 1:
            return "one Host and at most one Origin are expected"
        if _name(asked[0]) not in self.hosts | ({own_address.lower()} if own_address else set()):
            return "this host name is not served here"
        if origins and origins[0].lower() != f"http://{asked[0].lower()}":
            return "requests of other pages are not answered"
        if self.token and not (self.shown_in(path) or self._cookie(headers)):
            return "open the address with the token that was printed in the terminal"
        return None

    def shown_in(self, path: str) -> bool:
        """Whether the token stands in the address."""
        given = parse_qs(urlsplit(path).query).get("token", [""])[0]
        return bool(self.token) and _same(given, self.token)

    def _cookie(self, headers: Headers) -> bool:
        for line in headers.get_all("Cookie"):
            try:
                cookie = SimpleCookie(line).get(COOKIE)
            except CookieError:
                continue
            if cookie and _same(cookie.value, self.token):
                return True
        return False

    def page_headers(self, path: str) -> Mapping[str, str]:
        """Headers of the answer to a welcome request for a page."""
        if not self.shown_in(path):
            return PAGE_HEADERS
        cookie = f"{COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/"
        return {**PAGE_HEADERS, "Set-Cookie": cookie}


def _same(given: str, secret: str) -> bool:
    return hmac.compare_digest(given.encode(errors="surrogateescape"), secret.encode())


def _name(host: str) -> str:
    """The name in a `Host` header, without the port; "" if it is none."""
    try:
        parts = urlsplit(f"//{host}")
        return "" if parts.username or parts.path else (parts.hostname or "")
    except ValueError:
        return ""
