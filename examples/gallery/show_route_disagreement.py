r"""
A model and a recording that disagree, to the physics that was left out
=======================================================================

.. image:: /pictures/show_route_disagreement.png
   :alt: Held-out errors of three models, and the missing force over velocity: measured, and by the named law

A robot is tapped at rest and then milled. In the cut one of its joints rubs, which a linear model cannot show. With the
receptance :math:`H`, forces :math:`F` and the joint's direction :math:`d`,

.. math::

   X(\omega) = H(\omega)\,\big(F(\omega) - d\,G(\omega)\big), \qquad
   g(t) = F_c \tanh\left(\dot x_d(t) / v_s\right)

The diagnosis knows neither :math:`d` nor the law of :math:`g`. It finds both, and tests them on a recording that it did
not use.
"""

# %%
# A nominal model
# ---------------
# Five taps in X, Y and Z on the robot at rest.

import tempfile
import warnings
from pathlib import Path
from textwrap import fill

import matplotlib.pyplot as plt
import numpy as np

import millfrf as mf
from acquisition import record
from millfrf.mismatch import free_form_laws, improved_model_of
from replay_data import (
    LEVELS,
    ConcealedCell,
    ConcealedEffect,
    HammerCell,
    dynamometer,
    milling_force,
    posture_robot,
    tip_accelerometers,
)

warnings.simplefilter("ignore", mf.MillfrfWarning)  # the doubts of the diagnosis are printed below
temporary = tempfile.TemporaryDirectory()
folder = Path(temporary.name)
robot = posture_robot(np.random.default_rng(4))
sensors = dynamometer(0.01, 2000.0) + tip_accelerometers(0.01, high_pass_hz=None)
record(HammerCell(robot, sample_rate=2048.0, sensors=sensors, seed=0), folder / "taps.h5")
nominal = mf.fit(mf.tap(folder / "taps.h5").frf, band=(6, 45))
nominal

# %%
# Three recordings in the cut
# ---------------------------
# Three levels of force by the feed per tooth, 32 s each. The joint rubs with 7.64 N, along a direction between Y and Z.

direction = np.array([-0.094, -0.666, 0.740]) / np.linalg.norm([-0.094, -0.666, 0.740])
effect = ConcealedEffect("coulomb_friction", tuple(direction), {"friction_n": 7.64, "creep_speed_m_per_s": 1e-4})
recordings = []
for seed, level in enumerate(LEVELS):
    cell = ConcealedCell(robot, milling_force(robot, level, 32.0, seed), effect, 0.01, 10 + seed)
    recordings.append(folder / f"{level}.h5")
    record(cell, recordings[-1])

# %%
# From the recorded force the nominal model predicts another motion than was measured.

predicted = mf.predict(nominal, recordings[1])
figure, axes = plt.subplots(figsize=(8, 3.0), layout="constrained")
figure.set_label(
    "Acceleration at the tip in Y for half a second of the cut, measured, and predicted by the nominal model"
)
rate = predicted.description.sample_rate
part = slice(round(10.0 * rate), round(10.5 * rate))
time = np.arange(part.start, part.stop) / rate
axes.plot(time, predicted.measured[part, 1], color="0.6", linewidth=3, label="measured")
axes.plot(time, predicted.prediction.response[part, 1], color="0.0", linewidth=1, label="nominal model")
axes.set(xlabel="time (s)", ylabel="acceleration in Y (m/s²)")
axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
plt.show()

# %%
# The diagnosis
# -------------

found = mf.diagnose(nominal, *recordings)
print("verdict:", found.verdict)
for cause in found.physics:
    print(f"{cause.name} along {cause.location['direction']} (hidden: {direction.round(3).tolist()})")
    for name, value in cause.parameters.items():
        print(f"  {name}: {value:.4g} ± {2 * cause.standard_errors[name]:.2g} (two standard errors)")
for doubt in found.doubts:
    print(fill(doubt, 88, initial_indent="- ", subsequent_indent="  "))

# %%
# Held-out error
# --------------
# ``mid`` was kept from the search. Refitted modes cannot explain it, the named friction can, almost to the noise. The
# hidden friction turns its sign more slowly than the hyperbolic tangent: the improved model takes a free form of it.

gain = found.improvement
print(f"error on {gain.held_out}: {gain.before:.1%} nominal, {gain.refitted:.1%} refitted, {gain.after:.2%} improved")
print(mf.predict(improved_model_of(found), recordings[1]))

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
figure.set_label("Held-out errors of three models, and the missing force over velocity: measured, and by the named law")
found.plot(left)
left.set_ylabel("model")
left.legend(loc="lower right", frameon=False)

missing = free_form_laws(found)[0].damping
size, smooth = found.physics[0].parameters.values()
velocity = np.linspace(missing.at.min(), missing.at.max(), 301)
bars = {"fmt": "o", "color": "0.5", "markersize": 4, "label": "measured, without a law"}
right.errorbar(1e3 * missing.at, missing.force, 2 * missing.error, **bars)
right.plot(1e3 * missing.at, missing.law, color="0.0", linewidth=1, label="law of the improved model")
right.plot(1e3 * velocity, size * np.tanh(velocity / smooth), "--", color="C1", label="named law")
right.set(xlabel="velocity along the joint (mm/s)", ylabel="force beyond the linear model (N)")
right.legend(loc="upper left", frameon=False, fontsize="small")
plt.show()
temporary.cleanup()
# sphinx_gallery_thumbnail_number = 2
