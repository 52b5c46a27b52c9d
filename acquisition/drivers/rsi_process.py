"""The process that answers a KUKA controller, and a thread that takes what it passes on."""

import json
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from queue import Empty, Full, Queue
from typing import IO

from ..settings import SETTINGS
from ..sources.source import Disconnected
from . import rsi_answering


class AnsweringProcess:
    """The process `rsi_answering`, and a thread that takes the frames that the process writes."""

    def __init__(self, arguments: Sequence[str], where: str) -> None:
        command = [sys.executable, "-I", str(Path(rsi_answering.__file__)), *arguments]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(  # in a session of its own, so that Ctrl-C does not reach it
            command, stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True
        )
        self._frames: Queue[tuple[float, bytes] | None] = Queue(SETTINGS.queued_events)
        self.left_out: Counter[str] = Counter()  # packets left out, by reason
        self.stranger = ""  # last sender that is not believed
        self._closing = False
        self._thread = threading.Thread(target=self._read, name=f"{where} frames", daemon=True)
        self._thread.start()
        self.alive = True
        try:
            first_frame = self._frames.get(timeout=10.0)
        except Empty:
            first_frame = None
        if first_frame is None:
            reason = self.complaint()
            self.close()
            raise Disconnected(
                f"{where} cannot be opened: {reason}; check address and port, and that no other uses them"
            )

    def _read(self) -> None:
        assert self._process.stdout is not None
        while head := _exactly(self._process.stdout, rsi_answering.FRAME.size):
            arrival, length, kind = rsi_answering.FRAME.unpack(head)
            data = _exactly(self._process.stdout, length)
            if data is None:
                break
            if kind == rsi_answering.COUNTS:
                counts = json.loads(data)
                self.stranger = counts.pop("stranger")
                self.left_out = Counter(counts)
            else:
                self._pass_on((1e-9 * arrival, data))
        self._pass_on(None)

    def _pass_on(self, frame: tuple[float, bytes] | None) -> None:
        """Wait until there is room: the pipe fills, and the process counts what it cannot write."""
        while not self._closing:
            with suppress(Full):
                self._frames.put(frame, timeout=0.1)
                return

    def frames(self, duration: float) -> list[tuple[float, bytes]]:
        """Return the packets of the next ``duration`` seconds, each with the host's time of arrival, s."""
        packets, deadline = [], time.monotonic() + duration
        while self.alive and (left := deadline - time.monotonic()) > 0:
            try:
                frame = self._frames.get(timeout=left)
            except Empty:
                break
            if frame is None:
                self.alive = False
            else:
                packets.append(frame)
        return packets

    def complaint(self) -> str:
        """Return the error text that the process wrote at its end."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(1.0)
        if self._process.poll() is None or self._process.stderr is None:
            return "no answer"
        return self._process.stderr.read().decode("utf-8", "replace").strip() or f"exit code {self._process.returncode}"

    def close(self) -> None:
        """End the process and wait for it."""
        self._closing = True
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(SETTINGS.stop_time)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._thread.join()
        for pipe in (self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()


def _exactly(pipe: IO[bytes], size: int) -> bytes | None:
    """Read ``size`` bytes, or None at the end of the pipe."""
    data = pipe.read(size) if size else b""
    return data if len(data) == size else None
