"""A program for the kill tests: for each line on standard input it forks a writer that records until it is killed.

The writer's process number and then, after every acknowledged block, the number of rows go to standard output.
"""

import os
import sys

import numpy as np

from acquisition import HOST_AXIS, Channel, EventAxis, Events, RecordingWriter, StreamDescription

WIDTH = 3
AXES = {"speed": HOST_AXIS, "mark": EventAxis("host", texts=True)}


def rows(start: int, stop: int, rate: int) -> np.ndarray:
    """What row ``start`` to ``stop`` must hold."""
    return (np.arange(start, stop)[:, None] * rate + np.arange(WIDTH)).astype("f8")


def write_forever(path: str, seed: int) -> None:
    channels = tuple(Channel(f"a{k}", "acceleration", "m/s^2") for k in range(WIDTH))
    streams = [StreamDescription(name, 1000.0, 0.0, channels) for name in ("one", "two")]
    generator = np.random.default_rng(seed)
    dtype = "float64"
    with RecordingWriter(path, streams, dtype=dtype, block_length=512, event_axes=AXES) as writer:
        n = [0, 0]
        while True:
            block = int(generator.integers(1, 2000))
            for k, name in enumerate(("one", "two")):
                writer.append(name, rows(n[k], n[k] + block, k + 1))
                n[k] += block
                writer.append_clock_pair(name, n[k], n[k] / 1000.0)
            writer.append_events(Events("speed", np.array([float(n[0])]), np.array([2.0 * n[0]])))
            writer.append_events(Events("mark", np.array([float(n[0])]), np.zeros(1), None, (f"at {n[0]}",)))
            os.write(1, f"{n[0]}\n".encode())


def main() -> None:
    os.write(1, f"{os.getpid()}\n".encode())
    for line in sys.stdin:
        path, seed = line.split("\t")
        child = os.fork()
        if child == 0:
            write_forever(path, int(seed))
        os.write(1, f"pid {child}\n".encode())
        os.waitpid(child, 0)
        os.write(1, b"end\n")


if __name__ == "__main__":
    main()
