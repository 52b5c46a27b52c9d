"""
Why one immersion is not enough
===============================

A tooth's three forces rise and fall together. In one immersion they are one force in three directions: the matrix
:math:`S_{ff}` has one large eigenvalue, and its inverse is noise. Three immersions, stacked, have rank three on the
lines that the sweep of the tooth passing reaches.
"""

# %%
# Three sweeps of the spindle speed on the simulated cell, each in another immersion.

import tempfile
from dataclasses import replace
from math import pi
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from acquisition import Recording, record
from estimation import cross_spectra, input_independence, settings_for, sum_tests
from millfrf.cutting import MillingProcess
from replay_data import LinearSweep, MillingCell, default_structure

RPM = pi / 30
CUTTER = MillingProcess(2, 12.7e-3, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 0.15e-3)
IMMERSIONS = {"central": (0.38, 0.61), "down-milling": (0.77, 1.0), "up-milling": (0.0, 0.23)}
SECONDS, SEGMENT = 30.0, 4.0

tests = {}
with tempfile.TemporaryDirectory() as folder:
    for seed, (name, (start, leave)) in enumerate(IMMERSIONS.items()):
        process = replace(CUTTER, start_angle=start * pi, exit_angle=leave * pi)
        sweep = LinearSweep(450 * RPM, 690 * RPM, SECONDS)
        file = Path(folder) / f"{name}.h5"
        record(MillingCell(default_structure(), process, 2e-3, sweep, SECONDS, sample_rate=1024.0, seed=seed), file)
        with Recording(file) as recording:
            tests[name] = cross_spectra(recording, settings_for(recording.stream().sample_rate, SEGMENT))

# %%
# The condition of the scaled matrix, line by line. Above 10 000 (an eigenvalue 40 dB below the largest) no FRF is
# given. Between the harmonics only the noise of the sensors is left: it is independent, and so the condition is small
# there, although no force excites. A small condition alone is no proof of a good FRF.

figure, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
figure.set_label("Condition of the input matrix over frequency: one immersion above 10000, three stacked below 100")
cases = {"down-milling alone": tests["down-milling"], "three immersions": sum_tests(list(tests.values()))}
for (label, spectra), line, shade in zip(cases.items(), ("--", "-"), ("0.45", "0.0"), strict=True):
    found = input_independence(spectra, (10, 60))
    axes.semilogy(found.frequencies, found.condition, line, color=shade, label=label)
    shown = (found.frequencies >= 15) & (found.frequencies <= 23)
    print(f"{label}: median condition {np.median(found.condition[shown]):.3g} on the lines of the sweep")
axes.axhline(1e4, color="0.7", linewidth=1)
axes.text(45, 1.3e4, "no FRF above", fontsize=9, va="bottom")
axes.axvspan(15, 23, color="0.93")
axes.set(
    xlim=(10, 60), ylim=(1, 1e9), xlabel="frequency (Hz)", ylabel="largest over smallest\neigenvalue, inputs scaled"
)
axes.text(15.3, 2, "tooth passing", fontsize=9)
axes.legend(frameon=False, loc="upper right")
plt.show()
