"""
Two methods, two sources of error
=================================

The same three sweeps are fitted twice: from the recordings (subspace identification and maximum likelihood: no window,
no leakage) and from the FRF (poly-reference, on Hann segments that leak). Damping tells the difference.
"""

# %%
# Record three immersions of the simulated cell.

import tempfile
from dataclasses import replace
from math import pi
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import millfrf as mf
from acquisition import record
from millfrf.cutting import MillingProcess
from replay_data import LinearSweep, MillingCell, default_structure

RPM = pi / 30
CUTTER = MillingProcess(2, 12.7e-3, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 0.15e-3)
structure, files = default_structure(), []
folder = tempfile.TemporaryDirectory()
for seed, (start, leave) in enumerate(((0.38, 0.61), (0.77, 1.0), (0.0, 0.23))):
    process = replace(CUTTER, start_angle=start * pi, exit_angle=leave * pi)
    files.append(Path(folder.name) / f"sweep_{seed}.h5")
    sweep = LinearSweep(450 * RPM, 690 * RPM, 40.0)
    record(MillingCell(structure, process, 2e-3, sweep, 40.0, sample_rate=1024.0, seed=seed), files[-1])

# %%
# Fit both ways.

of_recordings = mf.fit(*files, band=(13, 45))
of_frf = mf.fit(mf.estimate(*files), band=(15.2, 45))
folder.cleanup()
print(of_recordings.model, of_frf.model, sep="\n")

# %%
# Poles of all orders of the subspace method, and the error of the damping against the simulated truth.

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
figure.set_label("Left: poles of the subspace method over model order. Right: error of damping of both methods")
chart = of_recordings.chart
hertz, shades = np.abs(chart.poles) / (2 * pi), ("0.8", "0.6", "0.4", "0.0")
for stability, shade in enumerate(shades):
    shown = (chart.stability == stability) & (hertz > 13) & (hertz < 45)
    words = ("new", "stable in frequency", "and in damping", "and in vector")[stability]
    left.plot(hertz[shown], chart.orders[shown], "o", color=shade, markersize=3, label=words)
left.set(xlabel="frequency (Hz)", ylabel="model order", xlim=(13, 45))
left.legend(frameon=False, fontsize=8, loc="center right")
true_zeta = np.array([0.0285, 0.0996])
names = ("subspace and\nmaximum likelihood", "poly-reference\nof the FRF")
for place, fitted in enumerate((of_recordings, of_frf)):
    off = 100 * (fitted.model.damping_ratios[:2] / true_zeta - 1)
    right.bar(place + np.array([-0.2, 0.2]), off, 0.35, color=("0.7", "0.3"), edgecolor="0.0")
    print(names[place].replace("\n", " "), "damping off by", np.round(off, 3), "%")
right.set_xticks((0, 1), names)
right.set(xlabel="method of the fit", ylabel="error of the damping (%)", title="light: 16.99 Hz, dark: 18.48 Hz")
right.axhline(0, color="0.0", linewidth=1)
plt.show()
