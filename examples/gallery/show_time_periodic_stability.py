"""
A cut that averaged coefficients call stable
============================================

At a low immersion a tooth is in the cut for a short part of its period. The zero-order solution averages the cutting
coefficients over the period and cannot see that the cut doubles its period. Collocation can: a Floquet multiplier
leaves the unit circle through -1.
"""

# %%
# Down-milling with a tenth of the diameter, on the two close modes of Table 1 of Mohammadi & Ahmadi.

from math import acos, pi

import matplotlib.pyplot as plt
import numpy as np

from millfrf.cutting import MillingProcess
from millfrf.stability import collocation, multipliers, zero_order
from replay_data import table_one_model

RPM = pi / 30
ENTRY = pi - acos(1 - 2 * 0.1)
CUT = MillingProcess(2, 12.7e-3, pi / 2, 119e6, 0.17, 0.33, ENTRY, pi, 0.15e-3)
model, speeds = table_one_model(), np.linspace(850, 1300, 91) * RPM
averaged, periodic = (solve(model, CUT, speeds, 10e-3) for solve in (zero_order, collocation))

print(
    f"lowest limit: averaged {1e3 * averaged.depth_limits.min():.2f} mm, "
    f"time-periodic {1e3 * periodic.depth_limits.min():.2f} mm"
)

# %%
# One speed, depths from 2 to 4 mm: where the largest multipliers lie in the complex plane.

SPEED, DEPTHS = 1080 * RPM, np.array([2.0, 2.5, 3.0, 3.5, 4.0]) * 1e-3
largest = [multipliers(model, CUT, SPEED, depth).values[:6] for depth in DEPTHS]
for depth, values in zip(DEPTHS, largest, strict=True):
    print(f"{1e3 * depth:.1f} mm: largest multiplier {values[0]:.3f}, |.| = {abs(values[0]):.3f}")

# %%
# Both in one figure; the dots on the left are the cuts on the right.

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained", width_ratios=(1.6, 1))
figure.set_label("Depth limits at low immersion, averaged and time-periodic; multipliers of one cut leave through -1")
left.plot(speeds / RPM, 1e3 * averaged.depth_limits, "--", color="0.5", label="averaged (zero-order)")
left.plot(speeds / RPM, 1e3 * periodic.depth_limits, "-", color="0.0", label="time-periodic (collocation)")
left.plot(np.full(len(DEPTHS), SPEED / RPM), 1e3 * DEPTHS, ".", color="0.3")
left.set(xlabel="spindle speed (rpm)", ylabel="depth limit (mm)", ylim=(0, 10))
left.legend(frameon=False, loc="upper left")
turn = np.exp(1j * np.linspace(0, 2 * pi, 200))
right.plot(turn.real, turn.imag, color="0.7", linewidth=1)
for depth, values, shade in zip(DEPTHS, largest, ("0.75", "0.6", "0.4", "0.2", "0.0"), strict=True):
    right.plot(values.real, values.imag, "o", color=shade, markersize=4, label=f"{1e3 * depth:.1f} mm")
right.set(xlabel="real part", ylabel="imaginary part", aspect="equal", xlim=(-2, 1.3), title="1080 rpm")
right.legend(frameon=False, fontsize=8, loc="upper left")
plt.show()
