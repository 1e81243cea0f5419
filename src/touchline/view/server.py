# SPDX-License-Identifier: Apache-2.0
"""The page's server: viser behind a guard, for this machine alone unless asked otherwise."""

import contextlib
import gzip
import io
import os
import secrets
import socket
import sys
from functools import lru_cache
from typing import Any
from unittest import mock

import viser
import websockets.asyncio.server
from websockets.http11 import Request, Response

from touchline.errors import InputError
from touchline.view.gate import Gate, gated
from touchline.view.guard import LOCAL_NAMES, Guard, is_local

HOST, PORT = "127.0.0.1", 8080
PORTS = 100  # that are tried from the wanted one on

# viser's grey and blue are too light to be read with ease on white, and white on them. `--soft`
# and `--alarm` are for texts of our own.
CONTRAST = """
:root { --soft: #5c636a; --alarm: #b00020; --mantine-color-dimmed: var(--soft) !important; }
:root[data-mantine-color-scheme=dark] { --soft: #b4bbc3; --alarm: #ff8a80; }
.mantine-Button-root { --button-bg: #1864ab !important; --button-hover: #144f87 !important; }
.mantine-Button-root { --button-color: #fff !important; }
"""
# On a telephone viser's panel lies over the view and hides the arm. Here it stands below the view.
NARROW = """
@media (max-width: 576px) {
  div:has(> .mantine-Paper-root[style*="position: fixed"]) { flex-direction: column; }
  div:has(> div > div > div > canvas) { flex: 1 1 0 !important; min-height: 0; }
  .mantine-Paper-root[style*="position: fixed"] {
    position: relative !important; flex: none; width: 100% !important; max-height: 55vh !important;
  }
  .mantine-Paper-root[style*="position: fixed"] [style*="width: 20em"] { width: 100% !important; }
}
"""
# viser's page is dark where its address says so. This runs before viser does.
SCHEME = """
(() => {
  const dark = matchMedia("(prefers-color-scheme: dark)"), address = new URL(location.href);
  if (dark.matches) address.searchParams.set("darkMode", "");
  else address.searchParams.delete("darkMode");
  if (address.href !== location.href) history.replaceState(null, "", address);
  dark.addEventListener("change", () => location.reload());
})();
"""
# viser leaves sliders, their fields and buttons with a symbol alone without a name, which those
# who do not see the page need. The label of a row names what is in it.
NAMES = """
(() => {
  const unnamed = "[role=slider], input:not([type=hidden]), textarea";
  const give = () => {
    for (const label of document.querySelectorAll("label[for]")) {
      const row = document.getElementById(label.htmlFor)?.closest(".mantine-Flex-root");
      const around = row?.contains(label) ? row : label.closest(".mantine-Flex-root");
      for (const field of around?.querySelectorAll(unnamed) ?? [])
        if (!field.getAttribute("aria-label")) field.setAttribute("aria-label", label.textContent);
    }
    for (const button of document.querySelectorAll("button:not([aria-label])"))
      if (!button.textContent.trim()) {
        const closes = button.className.includes("CloseButton");
        button.setAttribute("aria-label", closes ? "Close" : "Settings of the view");
      }
  };
  let due = 0;
  const soon = () => { due ||= setTimeout(() => { due = 0; give(); }, 200); };  // ms
  new MutationObserver(soon).observe(document, { childList: true, subtree: true });
})();
"""


class PageServer:
    """A viser server that answers nobody but its own page and programs on this machine.

    Args:
        label: heading of the page's panel.
        host: address to listen at; another than a loopback address needs a token, and prints a
            warning.
        port: the first that is tried; 0: any.
        token: whether a loopback address needs one, too: other users of this machine reach it.

    Attributes:
        page: the viser server, to add things to.
        url: address to open in a browser, with the token where one is needed.

    Raises:
        InputError: nothing can be listened at there.
    """

    def __init__(self, label: str, host: str = HOST, port: int = PORT, token: bool = False) -> None:
        local = is_local(host)
        self.token = secrets.token_urlsafe(24) if token or not local else ""
        names = LOCAL_NAMES if local else LOCAL_NAMES | _own_names(host)
        self.guard = Guard(names, self.token)
        if not local:
            print(WARNING.format(host=host), file=sys.stderr)
        self.page = _guarded(self.guard, label, host, _free_port(host, port))
        self.url = _url(host, self.page.get_port(), self.token)

    def stop(self) -> None:
        """Ends the server; its pages show that they have lost it."""
        with contextlib.redirect_stdout(io.StringIO()):
            self.page.stop()

    def __enter__(self) -> "PageServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


WARNING = """\
touchline: WARNING: listening at {host}, so other machines can see and move what the page shows.
The connection is not encrypted; whoever has the address below with its token is let in."""


def _own_names(host: str) -> frozenset[str]:
    return frozenset(name.lower() for name in (host, socket.gethostname(), socket.getfqdn()))


def _free_port(host: str, port: int) -> int:
    """The first port that can be listened at; viser itself would hang where there is none."""
    if not 0 <= port < 65536:
        raise InputError(f"--port {port}: must be from 0 to 65535")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    problem: OSError | None = None
    for candidate in [port] if port == 0 else range(port, min(port + PORTS, 65536)):
        with socket.socket(family, socket.SOCK_STREAM) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                trial.bind((host, candidate))
                return candidate
            except OSError as error:
                problem = error
    raise InputError(f"--host {host} --port {port}: cannot listen there: {problem}")


def _guarded(guard: Guard, label: str, host: str, port: int) -> viser.ViserServer:
    """Starts viser with the guard in front of its handler of requests.

    viser has no hook for that, so the function by which it starts to listen is replaced while it
    does. Without the guard in place there is no server.
    """
    serve, installed = websockets.asyncio.server.serve, []
    gates: list[Gate] = []

    def admits(message: bytes | str) -> bool:
        return all(gate.admits(message) for gate in gates)

    def serve_guarded(handler: Any, *args: Any, process_request: Any, **options: Any) -> Any:
        installed.append(True)
        answer = _answering(guard, process_request)
        return serve(gated(handler, admits), *args, process_request=answer, **options)

    quiet = contextlib.redirect_stdout(io.StringIO())  # viser prints its own address
    with mock.patch.object(websockets.asyncio.server, "serve", serve_guarded), quiet:
        page = viser.ViserServer(host=host, port=port, label=label, verbose=False)
    if not installed:
        page.stop()
        raise RuntimeError(f"viser {viser.__version__} cannot be guarded")
    gates.append(Gate(page))
    page.request_share_url = _no_sharing  # a visitor's message would open a tunnel to elsewhere
    page.gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
    return page


def _answering(guard: Guard, answer: Any) -> Any:
    def process(connection: Any, request: Request) -> Response | None:
        address = connection.local_address or ("",)
        refusal = guard.refusal(request.path, request.headers, str(address[0]))
        if refusal:
            return connection.respond(403, f"{refusal}\n")
        response = answer(connection, request)
        if response is not None:
            response.headers.update(guard.page_headers(request.path))
            _put_title(response)
        return response

    return process


def _put_title(response: Response) -> None:
    """Gives the page a title and names of its own; viser has no option for them."""
    if response.headers.get("Content-Type", "").startswith("text/html"):
        packed = response.headers.get("Content-Encoding") == "gzip"
        response.body = _titled(bytes(response.body or b""), packed)
        del response.headers["Content-Length"]
        response.headers["Content-Length"] = str(len(response.body))


@lru_cache(maxsize=2)  # with and without compression
def _titled(page: bytes, packed: bool) -> bytes:
    html = gzip.decompress(page) if packed else page
    scripts = f"<script>{SCHEME}</script><script>{NAMES}</script>"
    head = f"<title>Touchline</title>\n<style>{CONTRAST}{NARROW}</style>{scripts}"
    html = html.replace(b"<title>Viser</title>", head.encode(), 1)
    return gzip.compress(html) if packed else html


def open_page(url: str) -> None:
    """Opens a page in the browser, if there is a screen to show it on.

    Without one, a browser for terminals would take the terminal.
    """
    import webbrowser

    screen = sys.platform in ("darwin", "win32")
    if screen or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        webbrowser.open(url)


def _no_sharing(*_: Any, **__: Any) -> None:
    return None


def _url(host: str, port: int, token: str) -> str:
    shown = "127.0.0.1" if host in ("0.0.0.0", "::") else host
    if not is_local(host) and shown != host:
        shown = socket.gethostname()
    name = f"[{shown}]" if ":" in shown else shown
    return f"http://{name}:{port}/" + (f"?token={token}" if token else "")
