"""
Do error bars hold the truth?
=============================

An error bar is a promise: of many measurements 95 % of the intervals contain the true value. Here the same structure is
measured 30 times, each time with other noise, and fitted each time.
"""

# %%
# The truth, and an FRF with 1 % noise. The covariance of the noise goes with the FRF; of a measured one it comes from
# the cross spectra.

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from estimation import FrfCovariance
from modal_fit import fit_polyreference
from replay_data import default_structure, tip_model

truth = tip_model(default_structure())
clean = truth.frf(np.arange(8.0, 35.0, 0.125))
level = 0.01 * np.sqrt(np.mean(np.abs(clean.values) ** 2, axis=(0, 2)))
lines = len(clean.frequencies)
covariance = FrfCovariance(
    np.broadcast_to(np.diag(level**2).astype(complex), (lines, 3, 3)),
    np.broadcast_to(np.eye(3, dtype=complex), (lines, 3, 3)),
)

RUNS = 30
found, errors = np.empty((RUNS, 2)), np.empty((RUNS, 2))
for seed in range(RUNS):
    noise = np.random.default_rng(seed).standard_normal((2, *clean.values.shape)) * level[:, None] / np.sqrt(2)
    noisy = replace(clean, values=clean.values + noise[0] + 1j * noise[1], covariance=covariance)
    model = replace(fit_polyreference(noisy, (10.0, 30.0)).model, errors=None)
    bars = model.standard_errors()
    found[seed], errors[seed] = model.damping_ratios[:2], bars[1][:2]

# %%
# Bars that miss the truth are drawn in black. One or two of 30 are expected for each mode.

figure, panels = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained", sharex=True)
figure.set_label("Damping of two modes in 30 fits with 95 % bars; most contain the true value")
for k, axes in enumerate(panels):
    held = np.abs(found[:, k] - truth.damping_ratios[k]) < 1.96 * errors[:, k]
    for inside, shade in ((held, "0.6"), (~held, "0.0")):
        numbers = np.flatnonzero(inside)
        bars = 196 * errors[inside, k]
        axes.errorbar(numbers, 100 * found[inside, k], bars, fmt="o", color=shade, markersize=3, linewidth=1)
    axes.axhline(100 * truth.damping_ratios[k], color="0.0", linewidth=1, linestyle="--")
    title = f"mode {k + 1}, {truth.natural_frequencies[k]:.2f} Hz: {held.sum()} of {RUNS} hold the truth"
    axes.set(xlabel="measurement", ylabel="damping ratio (%)", title=title)
    print(title)
plt.show()
