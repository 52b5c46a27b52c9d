"""
What the shape of a cutter does to the lobes
============================================

The same tool tip with four end mills: straight edges, a helix, helix angles that differ, and a ball end. The edges are
cut into slices. Each slice has its own radius, edge angle, lag and immersion, and cuts what an earlier tooth left.
"""

# %%
# A bending mode in X and one in Y, half-immersion down-milling. A helix changes little. Helix angles that differ
# disturb the regeneration, as each height has its own delay. A ball enters the cut with its smaller radii later.

from math import pi, radians

import matplotlib.pyplot as plt
import numpy as np

from millfrf.cutting import MillingProcess, ball_profile
from millfrf.stability import certified_numerics
from modal_fit import ModalModel

RPM, DIAMETER, DEEPEST = pi / 30, 12e-3, 10e-3


def tip() -> ModalModel:
    """One mode in X and one in Y, 410 and 530 Hz, 3 % of critical damping."""
    omega = 2 * pi * np.array([410.0, 530.0])
    poles = omega * (-0.03 + 1j * np.sqrt(1 - 0.03**2))
    shapes = np.eye(2)
    right = shapes / (2j * 2.0 * poles.imag)[:, None]
    return ModalModel(poles, right, shapes + 0j, ("T:+X", "T:+Y"), ("T:+X", "T:+Y"))


def cut(**shape: object) -> MillingProcess:
    """Half-immersion down-milling with four teeth in aluminium."""
    return MillingProcess(4, DIAMETER, pi / 2, 8e8, 0.35, 0.15, pi / 2, pi, 1e-4, **shape)  # type: ignore[arg-type]


CUTTERS = {
    "straight edges": (cut(), "0.6", "-"),
    "helix 30 deg": (cut(helix_angle=radians(30)), "0.0", "--"),
    "helix 30, 38, 30, 38 deg": (cut(helix_angles=tuple(np.radians([30.0, 38.0, 30.0, 38.0]).tolist())), "0.0", "-"),
    "ball end": (cut(helix_angle=radians(30), profile=ball_profile(DIAMETER)), "0.35", "-."),
}
model, speeds = tip(), np.linspace(1500, 5500, 81) * RPM
limits = {name: certified_numerics(model, process, speeds, DEEPEST) for name, (process, _, _) in CUTTERS.items()}
for name, lobes in limits.items():
    print(f"{name}: lowest limit {1e3 * np.nanmin(lobes.depth_limits):.2f} mm")

# %%
# All in one figure.

figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
figure.set_label("Depth limits of the same tool tip with straight edges, a helix, helix angles that differ, a ball end")
for name, (_, shade, line) in CUTTERS.items():
    axes.plot(speeds / RPM, 1e3 * limits[name].depth_limits, line, color=shade, label=name)
axes.set(xlabel="spindle speed (rpm)", ylabel="depth limit (mm)", ylim=(0, 1e3 * DEEPEST), xlim=(1500, 5500))
figure.legend(frameon=False, loc="outside upper center", ncols=4)
plt.show()
