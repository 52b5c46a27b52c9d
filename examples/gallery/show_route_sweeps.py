r"""
Three sweeps while milling, to lobes
====================================

.. image:: /pictures/show_route_sweeps.png
   :alt: Depth limits over spindle speed from dynamics measured in the cut, and the true limits of the simulated robot

The milling force itself excites the robot. Its three components come from one chip, so that a single cut determines no
matrix; :math:`n` cuts in different immersions do, by their summed cross spectra

.. math::

   H(i\omega) = \Big(\sum_n S_{xf}^{(n)}\Big) \Big(\sum_n S_{ff}^{(n)}\Big)^{-1}
"""

# %%
# Three recordings
# ----------------
# A simulated robot mills acetal while its spindle sweeps from 450 to 690 rpm: the harmonics of the teeth pass every
# frequency. Force and acceleration at the tip are recorded for a minute. With recordings of your own, begin at the next
# section; sensors at the housing need ``mf.calibrate``, too.

import tempfile
import warnings
from dataclasses import replace
from math import pi
from pathlib import Path
from textwrap import fill

import matplotlib.pyplot as plt
import numpy as np

import millfrf as mf
from acquisition import record
from replay_data import (
    ACETAL_CUTTER,
    SWEEP_IMMERSIONS,
    LinearSweep,
    MillingCell,
    default_structure,
    dynamometer,
    tip_accelerometers,
    tip_model,
)

warnings.simplefilter("ignore", mf.MillfrfWarning)  # the warnings of each result are printed below
RPM, SECONDS = pi / 30, 60.0
robot = tip_model(default_structure())
sensors = dynamometer() + tip_accelerometers()
temporary = tempfile.TemporaryDirectory()
sweeps = []
for name, (start, leave) in SWEEP_IMMERSIONS.items():
    process = replace(ACETAL_CUTTER, start_angle=start * pi, exit_angle=leave * pi)
    profile = LinearSweep(450 * RPM, 690 * RPM, SECONDS)
    cell = MillingCell(robot, process, 2e-3, profile, SECONDS, sensors=sensors, seed=len(sweeps))
    sweeps.append(Path(temporary.name) / f"{name}.h5")
    record(cell, sweeps[-1])

# %%
# The FRF in the cut
# ------------------
# Only lines that the teeth excite are valid; the band in which the FRF holds begins at the lowest of them.

estimated = mf.estimate(*sweeps, band=(5, 60))
print(estimated)

# %%
# Modes with error bars
# ---------------------
# From the recordings themselves, by the subspace method, which needs no force on every line. The table shows two
# standard errors.

fitted = mf.fit(*sweeps, band=(13, 60))
fitted

# %%
# True values of the simulated robot, and the deviation in standard errors:

natural, damping = fitted.model.standard_errors()
for k, (frequency, error) in enumerate(zip(fitted.model.natural_frequencies, natural, strict=True)):
    true = robot.natural_frequencies[k]
    print(f"mode {k + 1}: {frequency:.4f} Hz, truth {true:.4f} Hz, {(frequency - true) / error:+.1f} standard errors")

# %%
# The estimate, the model, and the truth.

figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
figure.set_label("Receptance in X in the cut, estimated from three sweeps, with the fitted model and the true one")
entry = {"response": "TCP:+X", "excitation": "TCP:+X", "quantity": "receptance"}
estimated.plot(axes, **entry, color="0.6", linewidth=3, label="estimate")
axes.set_xlim(13, 60)
robot.plot(axes, **entry, color="0.0", linestyle="-", linewidth=0.8, label="truth")
fitted.plot(axes, **entry, label="fit")
plt.show()

# %%
# Lobes
# -----
# Half-immersion down-milling. Each limit is verified by Floquet multipliers, or its status says why not: here modes
# beyond 60 Hz, which the sweeps did not excite, may move it by more than 5 %. Taps of the tip would show them.

cut = mf.milling_process(
    teeth=2, diameter_m=0.0127, ktc_pa=119e6, krc=0.17, kac=0.33, start_angle_deg=90, exit_angle_deg=180
)
lobes = mf.lobes(fitted, cut, speeds=(800, 1600, 65), max_depth=0.008)
truth = mf.lobes(robot, cut, speeds=(800, 1600, 65), max_depth=0.008)
print(lobes)
for warning in lobes.warnings:
    print(fill(warning, 88, initial_indent="- ", subsequent_indent="  "))

both = np.isfinite(lobes.depth_limits) & np.isfinite(truth.depth_limits)
off = lobes.depth_limits[both] / truth.depth_limits[both] - 1
print(f"limits off by {off.min():.1%} to {off.max():+.1%} of the truth")

figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
figure.set_label("Depth limits over spindle speed from dynamics measured in the cut, and those of the simulated robot")
lobes.plot(axes, label="from the sweeps")
truth.plot(axes, label="truth")
axes.set_ylim(0, 5)
plt.show()
temporary.cleanup()
# sphinx_gallery_thumbnail_number = 2
