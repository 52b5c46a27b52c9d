"""
What the feed does to the lobes where coefficients depend on the chip
=====================================================================

The pressure on a thin chip is larger than on a thick one (Kienzle). A constant coefficient, measured at one feed, then
holds at this feed only. The same tool tip at three feeds, and with constant coefficients.
"""

# %%
# A bending mode in X and one in Y, up-milling at a quarter of the diameter with four teeth. The exponents are those of
# many steels: 0.25 along the cut and 0.5 across it. The constant coefficients are those of a chip of 0.1 mm.

from dataclasses import replace
from math import pi

import matplotlib.pyplot as plt
import numpy as np

from millfrf.cutting import ChipLaw, MillingProcess
from millfrf.stability import certified_numerics
from modal_fit import ModalModel

RPM, DEEPEST = pi / 30, 4e-3
LAW = ChipLaw((0.25, 0.5, 0.5), reference=1e-4, edge_radius=1e-5)


def tip() -> ModalModel:
    """One mode in X and one in Y, 410 and 530 Hz, 3 % of critical damping."""
    omega = 2 * pi * np.array([410.0, 530.0])
    poles = omega * (-0.03 + 1j * np.sqrt(1 - 0.03**2))
    shapes = np.eye(2)
    right = shapes / (2j * 2.0 * poles.imag)[:, None]
    return ModalModel(poles, right, shapes + 0j, ("T:+X", "T:+Y"), ("T:+X", "T:+Y"))


def cut(feed: float) -> MillingProcess:
    """Up-milling of a steel; its coefficients hold at a chip of 0.1 mm."""
    return MillingProcess(4, 0.012, pi / 2, 2.5e9, 0.4, 0.0, 0.0, pi / 3, feed, chip_law=LAW)


CUTS = {
    "0.04 mm per tooth": (cut(4e-5), "0.0", ":"),
    "0.1 mm": (cut(1e-4), "0.0", "--"),
    "0.25 mm": (cut(2.5e-4), "0.0", "-"),
    "constant coefficients": (replace(cut(1e-4), chip_law=ChipLaw()), "0.6", "-"),
}
model, speeds = tip(), np.linspace(1500, 8500, 141) * RPM
limits = {name: certified_numerics(model, process, speeds, DEEPEST) for name, (process, _, _) in CUTS.items()}
for name, lobes in limits.items():
    print(f"{name}: lowest limit {1e3 * np.nanmin(lobes.depth_limits):.3f} mm")

# %%
# All in one figure.

figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
figure.set_label("Depth limits of one tool tip at three feeds with coefficients that fall with the chip thickness")
for name, (_, shade, line) in CUTS.items():
    axes.plot(speeds / RPM, 1e3 * limits[name].depth_limits, line, color=shade, label=name)
axes.set(xlabel="spindle speed (rpm)", ylabel="depth limit (mm)", ylim=(0, 2), xlim=(1500, 8500))
figure.legend(frameon=False, loc="outside upper center", ncols=4)
plt.show()
