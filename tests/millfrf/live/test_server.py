"""The live page's address: its token, its names, its headers, in this machine's network and in another."""

import http.client
import logging
import subprocess
import sys
import urllib.error
import urllib.request
from urllib.parse import urlsplit

import pytest

from millfrf.core import InputError
from millfrf.live.control import LiveControl
from millfrf.live.monitor import LiveMonitor
from millfrf.live.server import LiveServer


def _status(url: str) -> int:
    try:
        with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(url, timeout=10) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


def test_the_page_is_on_loopback_behind_a_token(monitor: LiveMonitor) -> None:
    with LiveServer(monitor, LiveControl()) as server:
        root, token, rest = server.url.rsplit("/", 2)
        assert root.startswith("http://127.0.0.1:")
        assert (len(token) >= 32, rest) == (True, "")
        assert _status(server.url) == 200
        for wrong in ("", "/", "/live", f"/{token[:-1]}/", f"/{token}x/", f"/{token}", f"/{token}/../page.js", "/%00/"):
            assert _status(root + wrong) == 404, wrong
        for name in ("page.js", "page.css", "bokeh.min.js", "figures.json"):
            assert _status(server.url + name) == 200
        port = int(root.split(":")[2])
        with pytest.raises(InputError, match=r"cannot listen on 127.0.0.1 port"):
            LiveServer(monitor, LiveControl(), port=port).__enter__()


SOCKET = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}


def _answer(url: str, path: str, **headers: str) -> tuple[int, dict[str, str]]:
    parts = urlsplit(url)
    client = http.client.HTTPConnection(str(parts.hostname), parts.port, timeout=10)
    client.putrequest("GET", parts.path + path, skip_host="Host" in headers)
    for name, value in headers.items():
        client.putheader(name, value)
    client.endheaders()
    answer = client.getresponse()
    result = answer.status, dict(answer.getheaders())
    client.close()
    return result


def test_only_its_own_names_and_pages_are_answered(monitor: LiveMonitor) -> None:
    with LiveServer(monitor, LiveControl()) as server:
        url, port = server.url, urlsplit(server.url).port
        own, rebound = f"http://127.0.0.1:{port}", f"evil.example:{port}"
        assert _answer(url, "", Host=f"localhost:{port}")[0] == 200
        for host in (rebound, "127.0.0.1", f"127.0.0.1:{port}.evil.example", "", f"127.0.0.1:{port},{rebound}"):
            assert _answer(url, "", Host=host)[0] in (400, 421), host
        assert _answer(url, "live", Host=rebound, **{**SOCKET, "Origin": f"http://{rebound}"})[0] == 421
        for origin in (
            f"http://{rebound}",
            "null",
            f"https://127.0.0.1:{port}",
            f"{own}.evil.example",
            f"http://[::1]:{port}",
        ):
            assert _answer(url, "live", **{**SOCKET, "Origin": origin})[0] == 403, origin
        assert _answer(url, "live", **SOCKET)[0] == 403  # no browser's page
        assert _answer(url, "live", **{**SOCKET, "Origin": own})[0] == 101


def test_answers_allow_only_this_servers_scripts_and_name_no_server(monitor: LiveMonitor) -> None:
    with LiveServer(monitor, LiveControl()) as server:
        for path in ("", "figures.json", "none", "live"):
            headers = _answer(server.url, path)[1]
            policy = dict(part.strip().split(" ", 1) for part in headers["Content-Security-Policy"].split(";"))
            assert policy["default-src"] == policy["frame-ancestors"] == policy["base-uri"] == "'none'"
            assert policy["script-src"] == "'self'"
            assert headers["Referrer-Policy"] == "no-referrer"
            assert headers["Cache-Control"] == "no-store"
            assert headers["X-Content-Type-Options"] == "nosniff"
            assert "Server" not in headers


def test_no_log_holds_the_token(monitor: LiveMonitor, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG), LiveServer(monitor, LiveControl()) as server:
        token = server.url.rsplit("/", 2)[1]
        for path in ("", "none", "live", "page.js"):
            _answer(server.url, path)
            _answer(server.url, path, Host="evil.example")
        assert token not in repr(server._guard)
    assert token not in caplog.text


IN_A_NETWORK = """
import fcntl, http.client, socket, struct, urllib.error, urllib.request
from acquisition import Channel, StreamDescription
from millfrf.live.control import LiveControl
from millfrf.live.monitor import LiveMonitor, LiveSettings
from millfrf.live.server import LiveServer

def address(text):
    return struct.pack("HH4s8x", socket.AF_INET, 0, socket.inet_aton(text))

control = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # the namespace's own loopback gets a second address
fcntl.ioctl(control, 0x8916, struct.pack("16s16s8x", b"lo:1", address("192.0.2.1")))  # SIOCSIFADDR
fcntl.ioctl(control, 0x8914, struct.pack("16sH22x", b"lo", 0x41))  # SIOCSIFFLAGS: up

def status(url):
    try:
        with urllib.request.urlopen(url, timeout=10) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code

stream = StreamDescription("main", 1000.0, 0.0, (Channel("fx", "force", "N"),))
monitor = LiveMonitor([stream], LiveSettings())
with LiveServer(monitor, LiveControl(), "192.0.2.1") as server:
    root, token, _ = server.url.rsplit("/", 2)
    upgrade = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
    upgrade |= {"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="}
    print(root.rsplit(":", 1)[0], len(token) >= 32)
    print([status(url) for url in (server.url, root + "/", root, root + "/" + token[:-1] + "/", root + "/live")])
    for origin in ("http://192.0.2.7", root):
        client = http.client.HTTPConnection("192.0.2.1", int(root.rsplit(":", 1)[1]), timeout=10)
        client.request("GET", f"/{token}/live", headers=upgrade | {"Origin": origin})
        print(client.getresponse().status)
monitor.close()
"""


def test_on_another_address_the_page_demands_its_token() -> None:
    """In a network of its own (RFC 5737's address on a private loopback), so that nothing is reached from outside."""
    command = ["unshare", "-rn", sys.executable, "-c", IN_A_NETWORK]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    except FileNotFoundError:
        pytest.skip("no unshare: a network of its own cannot be made")
    if "unshare" in done.stderr:
        pytest.skip(f"a network of its own cannot be made here: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    where, pages, foreign, own = done.stdout.splitlines()
    assert where == "http://192.0.2.1 True"
    assert pages == "[200, 404, 404, 404, 404]"
    assert (foreign, own) == ("403", "101")  # a page of another site may not speak to it


@pytest.mark.parametrize("address", ["everywhere", "0.0.0.0", "::"])
def test_addresses_that_are_none_are_refused(monitor: LiveMonitor, address: str) -> None:
    with pytest.raises(InputError, match="give"):
        LiveServer(monitor, LiveControl(), address)
