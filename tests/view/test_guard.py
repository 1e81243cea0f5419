# SPDX-License-Identifier: Apache-2.0
"""The page answers itself and programs on this machine, and refuses pages from elsewhere."""

import base64
import gzip
import os
import socket
import urllib.request
from contextlib import ExitStack

import pytest
import viser
from browser import until
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from touchline.errors import InputError
from touchline.view import gate
from touchline.view.guard import Guard
from touchline.view.server import PageServer

PROTOCOL = f"viser-v{viser.__version__}"


@pytest.fixture(scope="module")
def server():
    with PageServer("test", port=0) as page:
        yield page


@pytest.fixture(scope="module")
def open_server():
    with PageServer("test", host="0.0.0.0", port=0) as page:
        yield page


def request(server, path="/", upgrade=False, **headers) -> tuple[int, str]:
    """Status and head of the answer to a request made by hand; a header None is left out."""
    port = server.page.get_port()
    sent = {"Host": f"127.0.0.1:{port}"}
    if upgrade:
        key = base64.b64encode(os.urandom(16)).decode()
        sent |= {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Key": key}
        sent |= {"Sec-WebSocket-Version": "13", "Sec-WebSocket-Protocol": PROTOCOL}
    sent |= {name.replace("_", "-"): value for name, value in headers.items()}
    lines = [f"GET {path} HTTP/1.1"]
    for name, value in sent.items():
        values = value if isinstance(value, list) else [] if value is None else [value]
        lines += [f"{name}: {v.format(port=port)}" for v in values]
    with socket.create_connection(("127.0.0.1", port), 5) as s:
        s.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        head = b""
        while b"\r\n\r\n" not in head and (part := s.recv(65536)):
            head += part
    return int(head.split()[1]), head.split(b"\r\n\r\n")[0].decode()


FOREIGN = [
    {"Host": "evil.example"},
    {"Host": "evil.example:{port}"},
    {"Host": "127.0.0.1.evil.example:{port}"},
    {"Host": "localhost.:{port}"},
    {"Host": "evil.example@127.0.0.1:{port}"},
    {"Host": "192.168.0.7:{port}"},
    {"Host": "0.0.0.0:{port}"},
    {"Host": "[::1"},
    {"Host": ""},
    {"Host": None},
    {"Host": ["127.0.0.1:{port}", "evil.example"]},
    {"Host": "evil.example:{port}", "Origin": "http://evil.example:{port}"},  # DNS rebinding
    {"Origin": "http://evil.example"},
    {"Origin": "https://evil.example:{port}"},
    {"Origin": "null"},
    {"Origin": ""},
    {"Origin": "file://"},
    {"Origin": "http://127.0.0.1:1"},  # another server of this machine
    {"Origin": "http://localhost:{port}"},  # another name than that asked for
    {"Origin": "http://127.0.0.1:{port}.evil.example"},
    {"Origin": ["http://127.0.0.1:{port}", "http://evil.example"]},
]


@pytest.mark.parametrize("upgrade", [False, True], ids=["page", "websocket"])
@pytest.mark.parametrize("headers", FOREIGN, ids=str)
def test_foreign_requests_are_refused(server, headers, upgrade):
    status, head = request(server, upgrade=upgrade, **headers)
    assert status == 403
    assert "Upgrade" not in head


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Origin": "http://127.0.0.1:{port}"},
        {"Host": "localhost:{port}"},
        {"Host": "LOCALHOST:{port}", "Origin": "http://localhost:{port}"},
        {"Host": "localhost:9000", "Origin": "http://localhost:9000"},  # a forwarded port
        {"Host": "[::1]:{port}"},
    ],
    ids=str,
)
def test_local_requests_are_answered(server, headers):
    assert request(server, **headers)[0] == 200
    assert request(server, upgrade=True, **headers)[0] == 101


def test_a_program_on_this_machine_may_connect(server):
    url = f"ws://127.0.0.1:{server.page.get_port()}"
    with connect(url, subprotocols=[PROTOCOL], compression=None, proxy=None) as client:
        assert len(client.recv(timeout=5)) > 16


def visitor(server):
    url = f"ws://127.0.0.1:{server.page.get_port()}"
    return connect(url, subprotocols=[PROTOCOL], compression=None, proxy=None)


def test_a_visitor_who_sends_too_many_messages_is_sent_away():
    with PageServer("test", port=0) as page:
        with visitor(page) as client, pytest.raises(ConnectionClosed) as closed:
            for _ in range(int(gate.BURST) + 5000):
                client.send(b"nonsense")
            while True:
                client.recv(timeout=10)
        assert closed.value.rcvd and closed.value.rcvd.code == gate.TOO_MANY
        with visitor(page) as client:  # others are let in
            assert len(client.recv(timeout=5)) > 16


def test_so_many_visitors_and_no_more():
    with PageServer("test", port=0) as page, ExitStack() as stack:
        first = stack.enter_context(visitor(page))
        for _ in range(gate.MOST_VISITORS - 1):
            stack.enter_context(visitor(page)).recv(timeout=5)
        with visitor(page) as late, pytest.raises(ConnectionClosed) as closed:
            late.recv(timeout=5)
        assert closed.value.rcvd and closed.value.rcvd.code == gate.LATER
        first.close()
        until(lambda: _is_let_in(page), what="room for another visitor")


def _is_let_in(server):
    with visitor(server) as client:
        try:
            return len(client.recv(timeout=5)) > 16
        except ConnectionClosed:
            return False


def test_a_page_that_is_used_is_not_sent_away():
    allowance = gate.Allowance(0.0)
    assert all(allowance.take(i / 250.0) for i in range(5000))
    fast = gate.Allowance(0.0)
    taken = [fast.take(i / 1000.0) for i in range(5000)]
    assert taken[:1000] == [True] * 1000 and not all(taken)


def test_the_page_may_load_nothing_from_elsewhere_and_stands_in_no_frame(server):
    _, head = request(server)
    assert "default-src 'self'" in head and "frame-ancestors 'none'" in head
    assert "http:" not in head and "https:" not in head


def test_listens_on_this_machine_alone(server):
    port = server.page.get_port()
    assert server.url == f"http://127.0.0.1:{port}/" and not server.token
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", port), 5)


def test_another_address_warns_and_needs_the_token(open_server, capsys):
    with PageServer("test", host="0.0.0.0", port=0) as another:
        warning = capsys.readouterr().err
        assert "WARNING" in warning and "0.0.0.0" in warning
        assert another.token != open_server.token
    for upgrade in (False, True):
        assert request(open_server, upgrade=upgrade)[0] == 403
        assert request(open_server, "/?token=wrong", upgrade=upgrade)[0] == 403
        assert request(open_server, Cookie="touchline-token=wrong", upgrade=upgrade)[0] == 403
    status, head = request(open_server, f"/?token={open_server.token}")
    assert status == 200
    cookie = next(x for x in head.splitlines() if x.startswith("Set-Cookie: "))
    assert "HttpOnly" in cookie and "SameSite=Strict" in cookie
    shown = cookie.removeprefix("Set-Cookie: ").split(";")[0]
    assert request(open_server, Cookie=f"a=b; {shown}", upgrade=True)[0] == 101
    with_token = {"Host": "evil.example", "Cookie": shown}
    assert request(open_server, upgrade=True, **with_token)[0] == 403


def test_the_address_that_a_connection_came_to_is_a_name_of_the_server(open_server):
    guard = open_server.guard

    class Asked:
        def get_all(self, key):
            return {"Host": ["192.168.0.7:80"], "Cookie": [f"touchline-token={guard.token}"]}.get(
                key, []
            )

    assert guard.refusal("/", Asked(), "192.168.0.7") is None
    assert guard.refusal("/", Asked(), "192.168.0.8") is not None
    assert Guard().refusal("/", Asked(), "127.0.0.1") is not None


def test_a_visitor_cannot_open_a_tunnel_to_elsewhere(server):
    assert server.page.request_share_url() is None


def test_the_next_port_is_taken_where_one_is_busy(server):
    busy = server.page.get_port()
    with PageServer("test", port=busy) as other:
        assert other.page.get_port() != busy


@pytest.mark.parametrize(
    ("host", "port", "named"),
    [("203.0.113.1", 8080, "--host"), ("127.0.0.1", 70000, "--port 70000: must be from 0")],
)
def test_an_address_that_is_not_ours_is_an_error(host, port, named):
    with pytest.raises(InputError, match=named):
        PageServer("test", host=host, port=port)


def test_a_browser_with_the_token_gets_in_and_one_without_does_not(open_server, browser):
    port = open_server.page.get_port()
    browser.open(f"http://127.0.0.1:{port}/")
    browser.wait_for("open the address with the token")
    assert not open_server.page.get_clients()
    browser.open(f"http://127.0.0.1:{port}/?token={open_server.token}")
    until(open_server.page.get_clients, pause=browser.rest, what="the page's connection")


def test_this_machine_needs_a_token_too_where_that_is_asked_for(capsys):
    with PageServer("test", port=0, token=True) as closed:
        assert "WARNING" not in capsys.readouterr().err
        for upgrade in (False, True):
            assert request(closed, upgrade=upgrade)[0] == 403
        assert closed.url.startswith("http://127.0.0.1:") and closed.token in closed.url
        assert request(closed, f"/?token={closed.token}")[0] == 200


@pytest.mark.parametrize("packing", ["gzip", "identity"])
def test_the_page_has_a_title_of_its_own(server, packing):
    url = f"http://127.0.0.1:{server.page.get_port()}/"
    asked = urllib.request.Request(url, headers={"Accept-Encoding": packing})
    with urllib.request.urlopen(asked, timeout=10) as answer:
        body = answer.read()
        assert answer.headers["Content-Encoding"] == packing
    html = gzip.decompress(body) if packing == "gzip" else body
    assert html.count(b"<title>") == 1 and b"<title>Touchline</title>" in html
    assert html.rstrip().endswith(b"</html>")
