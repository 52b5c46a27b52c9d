"""Spectra leave no thread behind: a process that holds threads of a library may wait for ever when it is copied."""

import os
import subprocess
import sys

import pytest

SCRIPT = """
import os
import time
import numpy as np
from acquisition import Channel
from estimation import SpectralAccumulator, SpectralSettings

force = tuple(Channel(f"f{a}", "force", "N", "TCP", f"+{a.upper()}") for a in "xyz")
motion = tuple(Channel(f"a{k}", "acceleration", "m/s^2", f"P{k}", "+X") for k in range(3))
drawn = np.random.default_rng(0)
accumulator = SpectralAccumulator(force, motion, 1024.0, SpectralSettings(4096, 0.5, "hann"))
accumulator.add(drawn.normal(size=(65536, 3)), drawn.normal(size=(65536, 3)))
assert accumulator.result().n_segments == 31
# a thread that has ended stays in the list for a moment; one of a pool stays for ever
end = time.monotonic() + 10
while len(os.listdir("/proc/self/task")) > 1 and time.monotonic() < end:
    time.sleep(0.01)
print(len(os.listdir("/proc/self/task")))
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="counts threads as Linux lists them")
def test_no_thread_is_left_when_spectra_are_made() -> None:
    one_thread = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=os.environ | one_thread, capture_output=True, text=True, check=True
    )
    assert int(done.stdout) == 1
