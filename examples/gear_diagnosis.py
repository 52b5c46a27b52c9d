"""What does a robot's geared joint lose to friction? A diagnosis of the seventh joint of a Franka arm.

The torque sensor of the joint (a strain-wave gear), less what rigid links take and gravity, with angle and velocity,
while the arm ran along one path at three speeds (data of "NNFM: A Novel Neural Network Modeling Approach for Robot
Flexible Joints Friction Considering Abrupt Non-smooth Properties", `Comparative data/Franka Robot` of
github.com/longshike/NNFM-A-Novel-Neural-Network-Modeling-Approach-for-Robot-Flexible-Joints-Friction). In the same rows
stand the torques that four friction laws and four learned models of the authors give.

A joint that is made to follow a path has no mode. A known inertia, damper and spring are therefore laid around it,

    J q'' + d q' + k q = M - g,    M = J q'' + d q' + k q + measured friction,

so that the model is a mode, and the missing moment g is the gear's friction as it was measured.

Run it: `python examples/gear_diagnosis.py FOLDER [PICTURE.png]`; FOLDER holds `case4_slow.csv`, `case4_middle.csv` and
`case4_high.csv`. `... FOLDER loops` repeats the diagnosis with other inertias and modes.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt

from estimation import BandRecording, channels_of
from millfrf.figures import COLOURS, house_style, new_figure
from millfrf.mismatch import StructureDiagnosis, diagnose
from modal_fit import ModalModel

Real = NDArray[np.float64]

NAMES = ("slow", "middle", "high")
LEARNED = ("CV", "Dahl", "Stribeck", "LuGre", "SVM", "Light_Transformer", "PINN", "NNFM")
"""Columns with the authors' models: Coulomb and viscous, three laws with memory or fall, and four learned ones."""

RATE, CUTOFF = 50.0, 10.0
"""Hz: evenly spaced samples that are kept, and the filter without phase before them."""

MODE = (2.0, 0.7)
"""Frequency (Hz) and damping ratio of the mode that the known inertia, spring and damper make."""

INERTIA = 0.4
"""kg m^2, of that mode: friction is then about a tenth of the outer moment."""

LOOPS = ((1.0, 0.1), (1.0, 0.4), (1.0, 4.0), (2.0, 0.1), (2.0, 0.4), (2.0, 1.0), (4.0, 0.1), (4.0, 0.25))
"""Frequencies (Hz) and inertias (kg m^2) of other loops."""

SMOOTH = 0.004
"""rad/s over which the sign of dry friction turns, for the regression."""

TRAINED = 0.6
"""Share of each record that is read; the rest is predicted."""


@dataclass(frozen=True)
class Motion:
    """One record, evenly sampled.

    Parameters
    ----------
    angle, velocity, acceleration, friction : (n,)
        rad, rad/s, rad/s^2, N m.
    learned : (n, 8)
        Friction torque that the authors' models give, N m.
    """

    angle: Real
    velocity: Real
    acceleration: Real
    friction: Real
    learned: Real

    def part(self, kept: slice) -> "Motion":
        return Motion(*(getattr(self, name)[kept] for name in self.__dataclass_fields__))


def read_motion(path: Path) -> Motion:
    """Read one file, spread its uneven samples evenly, and filter all alike.

    The files' time runs at half speed beside the ratio of the angle's change to the velocity; the velocity is believed.
    """
    table = np.genfromtxt(path, delimiter=",", skip_header=1)
    time, kept = np.unique(table[:, 0], return_index=True)
    table = np.nan_to_num(table[kept], posinf=0.0, neginf=0.0)
    change = np.gradient(table[:, 1], time)
    time = time * float(np.sum(change * table[:, 2]) / np.sum(table[:, 2] ** 2))
    fine = 5 * RATE
    even = np.arange(time[0], time[-1], 1 / fine)
    columns = np.column_stack([np.interp(even, time, table[:, k]) for k in (1, 4, *range(5, 13))])
    smooth = filtfilt(*butter(4, 2 * CUTOFF / fine), columns, axis=0)
    velocity = np.gradient(smooth[:, 0], 1 / fine)
    whole = Motion(smooth[:, 0], velocity, np.gradient(velocity, 1 / fine), smooth[:, 1], smooth[:, 2:])
    return whole.part(slice(int(fine), -int(fine), 5))


def modal_model(mode: tuple[float, float] = MODE, inertia: float = INERTIA) -> ModalModel:
    """The known inertia, spring and damper as a mode, rad/N m."""
    pole = 2 * np.pi * mode[0] * complex(-mode[1], np.sqrt(1 - mode[1] ** 2))
    left = np.array([[1 / (inertia * 2j * pole.imag)]])
    unity = np.ones((1, 1), dtype=complex)
    return ModalModel(np.array([pole]), unity, left, ("GEAR:+X",), ("GEAR:+X",), unit="rad/N m")


def as_trial(name: str, motion: Motion, mode: tuple[float, float] = MODE, inertia: float = INERTIA) -> BandRecording:
    """Outer moment and angle of a record."""
    omega = 2 * np.pi * mode[0]
    angle = motion.angle - motion.angle.mean()
    around = motion.acceleration + 2 * mode[1] * omega * motion.velocity + omega**2 * angle
    moment = inertia * around + motion.friction - motion.friction.mean()
    channels = channels_of("moment", ["GEAR:+X"], ["moment"]), channels_of("angle", ["GEAR:+X"], ["angle"])
    return BandRecording(name, RATE, moment[:, None], angle[:, None], *channels)


def halves(motion: Motion) -> tuple[Motion, Motion]:
    """The part that is read, and the part that is predicted."""
    n = int(TRAINED * len(motion.angle))
    return motion.part(slice(0, n)), motion.part(slice(n, None))


def columns_of(motion: Motion, dry: bool) -> Real:
    """What the friction torque is regressed on: linear terms, and dry friction if it is asked for."""
    rows = [motion.velocity, motion.angle, np.ones_like(motion.angle)]
    return np.column_stack([*rows, np.tanh(motion.velocity / SMOOTH)] if dry else rows)


def regressed(records: dict[str, Motion], dry: bool) -> Real:
    """Numbers of the regression over the read parts of all records."""
    parts = [halves(each)[0] for each in records.values()]
    design = np.vstack([columns_of(each, dry) for each in parts])
    return np.asarray(np.linalg.lstsq(design, np.concatenate([each.friction for each in parts]), rcond=None)[0])


def share_left(shown: Real, motion: Motion) -> float:
    """Root mean square error of a friction torque over the torque's standard deviation."""
    return float(np.sqrt(np.mean((shown - motion.friction) ** 2)) / np.std(motion.friction))


def torque_errors(records: dict[str, Motion]) -> dict[str, tuple[float, ...]]:
    """Errors on the parts not read, by model and record."""
    later = {name: halves(each)[1] for name, each in records.items()}
    result = {}
    for name, dry in (("linear terms", False), ("linear terms and dry friction", True)):
        numbers = regressed(records, dry)
        result[name] = tuple(share_left(columns_of(each, dry) @ numbers, each) for each in later.values())
    for k, name in enumerate(LEARNED):
        result[name] = tuple(share_left(each.learned[:, k], each) for each in later.values())
    return result


def study(records: dict[str, Motion], mode: tuple[float, float] = MODE, inertia: float = INERTIA) -> StructureDiagnosis:
    """What the diagnosis makes of the first parts of the records."""
    trials = [as_trial(name, halves(each)[0], mode, inertia) for name, each in records.items()]
    return diagnose(modal_model(mode, inertia), trials)


def told(found: StructureDiagnosis) -> str:
    """Verdict, causes, error held out and what was ranked first, in a line."""
    causes = ", ".join(f"{one.name} {dict(one.parameters)}" for one in found.physics)
    gain, first = found.improvement, max(found.candidates, key=lambda one: one.evidence, default=None)
    ranked = "" if first is None else f"; first of all weighed: {first.name}, {first.stage}, {first.evidence:.0f}"
    errors = ", ".join(f"{100 * one:.1f} %" for one in (gain.before, gain.refitted, gain.after, gain.noise_floor))
    return f"{found.verdict}: {causes or 'nothing'}; nominal, refitted, improved, noise: {errors}{ranked}"


def picture(records: dict[str, Motion]) -> Figure:
    """Measured friction torque over velocity at the three speeds, with the regression."""
    numbers = regressed(records, dry=True)
    with house_style():
        figure = new_figure(70)
        panels = figure.subplots(1, len(records), sharey=True)
        for axes, (name, each) in zip(panels, records.items(), strict=True):
            axes.plot(each.velocity, each.friction, ".", markersize=1.5, color="#999999", label="Measured")
            axes.plot(
                each.velocity, columns_of(each, True) @ numbers, ".", markersize=1, color=COLOURS[1], label="Regression"
            )
            axes.set(xlabel="Velocity (rad/s)", title=name.capitalize())
        panels[0].set_ylabel("Friction torque (N m)")
        panels[-1].legend(loc="lower right", markerscale=6, handletextpad=0.2, frameon=False)
    return figure


def main(folder: Path, target: Path | None) -> None:
    """Print what is said and what is left, and draw the friction."""
    records = {name: read_motion(folder / f"case4_{name}.csv") for name in NAMES}
    result = study(records)
    print(told(result))
    behaviour = result.details.behaviour
    print("behaviour:", "" if behaviour is None else behaviour.sentence)
    for name, errors in torque_errors(records).items():
        print(f"{name}: " + ", ".join(f"{100 * each:.0f} %" for each in errors))
    if target is not None:
        picture(records).savefig(target, dpi=150)


def other_loops(folder: Path) -> None:
    """What is said with other loops: an honest answer would not depend on them."""
    records = {name: read_motion(folder / f"case4_{name}.csv") for name in NAMES}
    for frequency, inertia in LOOPS:
        print(
            f"{frequency:g} Hz, {inertia:g} kg m^2: {told(study(records, (frequency, MODE[1]), inertia))}", flush=True
        )


if __name__ == "__main__":
    if sys.argv[2:] == ["loops"]:
        other_loops(Path(sys.argv[1]))
    else:
        main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
