"""
A robot is soft, and softer where it reaches far
================================================

Joint stiffness does not change; the lever does. Compliance at the tool is :math:`C = J K^{-1} J^T`, and both it and
the lowest natural frequency change by a factor over the work area.
"""

# %%
# The KUKA KR90 of the examples along a line away from its base, tool down, 0.7 m above the floor.

import matplotlib.pyplot as plt
import numpy as np

from millfrf.robot_model import modal_model_at, read_spatial_robot, target_of, tool_down, wrist_solutions

robot = read_spatial_robot("kuka_kr90_r3100").robot
reach = np.linspace(1.2, 2.6, 15)
frequencies, compliance = [], []
for x in reach:
    posture = wrist_solutions(robot.mechanism, target_of(tool_down([x, 0.0, 0.7])))[0]
    model = modal_model_at(robot, posture)
    frequencies.append(model.natural_frequencies[:3])
    static = model.receptance(np.array([0.01]))[0].real
    compliance.append(np.linalg.eigvalsh((static + static.T) / 2)[::-1])

# %%
# Lowest frequencies, and the three principal compliances at the tool.

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
figure.set_label("Natural frequencies fall and compliance grows as the robot reaches out")
for k, line in enumerate(("-", "--", ":")):
    left.plot(reach, np.array(frequencies)[:, k], line, color="0.0", label=f"mode {k + 1}")
    right.plot(reach, 1e6 * np.array(compliance)[:, k], line, color="0.0", label=("softest", "middle", "stiffest")[k])
left.set(xlabel="distance from the base (m)", ylabel="natural frequency (Hz)", ylim=(0, None))
right.set(xlabel="distance from the base (m)", ylabel="compliance (µm/N)", ylim=(0, None))
left.legend(frameon=False)
right.legend(frameon=False)
print(f"lowest mode {frequencies[0][0]:.1f} to {frequencies[-1][0]:.1f} Hz")
print(f"softest direction {1e6 * compliance[0][0]:.2f} to {1e6 * compliance[-1][0]:.2f} um/N")
plt.show()
