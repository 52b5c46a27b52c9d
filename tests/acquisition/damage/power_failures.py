"""Images of a recording after a power failure: what was synced is there, of the rest any sectors in any order.

`logged_recording` has a writer's every write, resize and sync logged (``written_pages.c``, preloaded with the dynamic
linker); `images` makes files from the log.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

PAGE, SECTOR = 4096, 512  # bytes that a disk writes as a whole or not at all
WRITE, RESIZE, SYNC, ACKNOWLEDGED = 1, 2, 3, 4

WRITER = """
import ctypes, sys, time
import numpy as np
from acquisition import Channel, Events, HOST_AXIS, RecordingWriter, StreamDescription

acknowledge = ctypes.CDLL(None).acknowledge
acknowledge.argtypes = [ctypes.c_uint64]
channels = tuple(Channel(f"a{k}", "acceleration", "m/s^2") for k in range(4))
generator = np.random.default_rng(int(sys.argv[2]))
rows = np.random.default_rng(7).standard_normal((200_000, 4)).astype("f4")
at = 0
stream = StreamDescription("main", 10_240.0, 0.0, channels)
with RecordingWriter(sys.argv[1], [stream], event_axes={"speed": HOST_AXIS}, block_length=int(sys.argv[4])) as writer:
    begun = time.monotonic()
    while time.monotonic() - begun < float(sys.argv[3]) and at + 1500 <= len(rows):
        count = int(generator.integers(100, 1500))
        writer.append("main", rows[at : at + count], at)
        at += count
        writer.append_clock_pair("main", at, at / 10_240.0)
        writer.append_events(Events("speed", np.array([float(at)]), np.array([2.0 * at])))
        acknowledge(at)
        time.sleep(0.01)
    import os
    os._exit(9)
"""


def true_rows() -> np.ndarray:
    """What the writer records, row by row."""
    return np.random.default_rng(7).standard_normal((200_000, 4)).astype("f4")


@dataclass(frozen=True)
class Step:
    """One entry of the log: kind, offset (size of the file, or rows acknowledged), and the bytes written."""

    kind: int
    offset: int
    data: bytes


def preloaded(folder: Path) -> Path:
    """The library that logs what is written, compiled."""
    library = folder / "written_pages.so"
    source = Path(__file__).with_name("written_pages.c")
    subprocess.run(["gcc", "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl", "-lpthread"], check=True)
    return library


def logged_recording(folder: Path, seed: int, seconds: float, chunk: int = 4096) -> list[Step]:
    """Record for some seconds, end without closing, and return the log."""
    path, log = folder / "logged.h5", folder / "log"
    environment = os.environ | {
        "LD_PRELOAD": str(preloaded(folder)),
        "WRITTEN_FILE": "/logged.h5",
        "WRITTEN_LOG": str(log),
    }
    command = [sys.executable, "-c", WRITER, str(path), str(seed), str(seconds), str(chunk)]
    done = subprocess.run(command, env=environment, capture_output=True)
    assert done.returncode == 9, done.stderr.decode()[-2000:]
    return list(_steps(log.read_bytes()))


def _steps(raw: bytes) -> Iterator[Step]:
    at = 0
    while at < len(raw):
        kind, offset, length = (int(each) for each in np.frombuffer(raw, "<u8", 3, at))
        at += 24
        yield Step(kind, offset, raw[at : at + length])
        at += length


def image(steps: list[Step], generator: np.random.Generator, size_of_page: int = PAGE) -> tuple[bytes, int]:
    """The file after a failure at a random moment, and the number of rows that were synced by then.

    Every page that was written after the last sync holds what it held at some moment since; the file has the size that
    it had at one.
    """
    syncs = [k for k, each in enumerate(steps) if each.kind == SYNC]
    failure = int(generator.integers(syncs[0] + 1, len(steps)))
    synced = max(k for k in syncs if k < failure)
    held = bytearray()
    acknowledged = _apply(held, steps[:synced])
    sizes = [len(held)]
    versions: dict[int, list[bytes]] = {}
    later = bytearray(held)
    for each in steps[synced:failure]:
        _apply(later, [each])
        sizes.append(len(later))
        if each.kind == WRITE:
            for page in range(each.offset // size_of_page, (each.offset + len(each.data) - 1) // size_of_page + 1):
                part = slice(page * size_of_page, (page + 1) * size_of_page)
                before, now = (bytes(image_bytes[part]).ljust(size_of_page, b"\0") for image_bytes in (held, later))
                versions.setdefault(page, [before]).append(now)
    size = sizes[int(generator.integers(len(sizes)))]
    result = bytearray(held[:size].ljust(size, b"\0"))
    for page, contents in versions.items():
        chosen = contents[int(generator.integers(len(contents)))]
        begin = page * size_of_page
        if begin < size:
            result[begin : begin + size_of_page] = chosen[: size - begin]
    return bytes(result), acknowledged


def _apply(held: bytearray, steps: list[Step]) -> int:
    """Let writes and resizes happen; returns the rows acknowledged last."""
    acknowledged = 0
    for each in steps:
        if each.kind == WRITE:
            held.extend(bytes(max(0, each.offset + len(each.data) - len(held))))
            held[each.offset : each.offset + len(each.data)] = each.data
        elif each.kind == RESIZE:
            del held[each.offset :]
            held.extend(bytes(each.offset - len(held)))
        elif each.kind == ACKNOWLEDGED:
            acknowledged = each.offset
    return acknowledged
