r"""
One tap test in X and Y, to a depth that holds
==============================================

.. image:: /pictures/show_route_taps.png
   :alt: A sheet for the machine with the recommended cut, its lobes, and what was not measured

Two recordings of hammer taps at the tool tip become this sheet. With the receptance :math:`H` of the tip and the
directional matrix :math:`\alpha` of the cut, a cut of depth :math:`a` is at its limit of stability where

.. math::

   \det\left(I - a\,K_{tc}\,(1 - e^{-i\omega\tau})\,\alpha\,H(i\omega)\right) = 0

(:math:`\tau`: time between two teeth; :math:`\alpha` is averaged here, the limits below use its course over time).
"""

# %%
# Two recordings
# --------------
# A simulated robot is tapped four times in X, then four times in Y. One accelerometer measures along the tap, so the
# cross terms (hit X, measure Y) stay unknown. With recordings of your own, begin at the next section.

import tempfile
import warnings
from pathlib import Path
from textwrap import fill

import matplotlib.pyplot as plt
import numpy as np

import millfrf as mf
from acquisition import record
from millfrf.core import TIP
from millfrf.cutting import write_cutting_process
from replay_data import HammerCell, default_structure, dynamometer, select, tip_accelerometers

warnings.simplefilter("ignore", mf.MillfrfWarning)  # the warnings of each result are printed below
temporary = tempfile.TemporaryDirectory()
folder = Path(temporary.name)

for axis, name in enumerate(("x.h5", "y.h5")):
    sensors = (dynamometer(0.001, 2000.0)[axis], tip_accelerometers(0.001)[axis])
    options = {"taps": 4, "spacing": 4.0, "sample_rate": 1024.0, "sensors": sensors, "seed": axis}
    record(HammerCell(default_structure(), directions=[TIP[axis]], **options), folder / name)

# %%
# From taps to modes
# ------------------
# ``tap`` finds the taps, leaves out double hits and overloads, and averages. ``fit`` gives poles and mode shapes.

tapped = mf.tap(folder / "x.h5", folder / "y.h5", out=folder / "tip.h5")
print(tapped)

fitted = mf.fit(tapped.frf, band=(8, 120), out=folder / "tip.json")
fitted

# %%
# The synthesis lies on the measurement; dotted vertical lines are natural frequencies.

figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
figure.set_label(
    "Direct accelerances in X and in Y from four taps each, with the synthesis of the fitted model over them"
)
measured = tapped.frf.sel(band=(8, 120))
for direction, shade, label in zip(TIP, ("0.5", "0.75"), ("fit", "_nolegend_"), strict=False):
    entry = {"response": direction, "excitation": direction}
    measured.plot(axes, **entry, color=shade, linestyle="-", linewidth=3, label=f"{direction}, taps")
    axes.set_xlim(8, 120)
    fitted.plot(axes, **entry, label=label)
plt.show()

# %%
# From modes to depth limits
# --------------------------
# The cut: a two-fluted mill in acetal, down-milling with half of its diameter. Lengths are in metres, angles in
# degrees. The robot is simulated, so its true limits, cross terms included, are known, too.

cut = mf.milling_process(
    teeth=2, diameter_m=0.0127, ktc_pa=119e6, krc=0.17, kac=0, start_angle_deg=90, exit_angle_deg=180
)
searched = {"speeds": (600, 1800, 61), "max_depth": 0.008}
lobes = mf.lobes(fitted, cut, **searched, out=folder / "lobes.csv")
truth = mf.lobes(select(default_structure(), TIP[:2], TIP[:2]), cut, **searched)
for warning in lobes.warnings:
    print(fill(warning, 88, initial_indent="- ", subsequent_indent="  "))

# %%
# Cross terms that nobody measured make these limits up to a third too high. None is ``verified``: the line is dotted.

figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
figure.set_label("Depth limits over spindle speed from the taps, and the true limits of the robot with cross terms")
lobes.plot(axes, label="from the taps")
truth.plot(axes, label="truth")
axes.set_ylim(0, 6)
plt.show()

both = np.isfinite(lobes.depth_limits) & np.isfinite(truth.depth_limits)
off = lobes.depth_limits[both] / truth.depth_limits[both] - 1
print(f"limits from the taps are off by {off.min():.0%} to {off.max():+.0%}")

# %%
# The sheet for the machine
# -------------------------
# The recommended cut deducts what unmeasured cross terms and modes outside the band could take away: its depth holds
# for the true robot, although the limits do not. For more depth hit X and measure Y, and the reverse.

write_cutting_process(folder / "cut.toml", cut)
files = [folder / name for name in ("tip.h5", "tip.json", "lobes.csv", "cut.toml")]
mf.report(*files, out=folder / "report.html", sheet=folder / "sheet.png", title="Two tap tests")

sheet = plt.imread(folder / "sheet.png")
figure, axes = plt.subplots(figsize=(7, 8.7), layout="constrained")
figure.set_label("A sheet for the machine with the recommended cut, its lobes, and what was not measured")
axes.imshow(sheet[: round(0.88 * len(sheet))], interpolation="antialiased")  # the rest of the page is blank
axes.set_axis_off()
plt.show()
temporary.cleanup()
# sphinx_gallery_thumbnail_number = 2
