"""What does a rigid mass with viscous friction leave out of a robot's prismatic drive? The tool names it.

EMPS, an electro-mechanical positioning system in closed loop (Janot, Gautier & Brunot, Data set and reference models of
EMPS, Nonlinear System Identification Benchmarks, Eindhoven 2019): motor command in, position out. The nominal model
``M q'' + c q' = F`` has no oscillating mode and a pole at zero, so that a known spring and damper are laid around drive
and model alike: with ``F + k q + d q'`` as outer force, both sides of the equation of motion are unchanged,

    M q'' + (c + d) q' + k q = (F + k q + d q') - g(q'),

and the model is a mode at 2 Hz, with 70 % damping, whose missing force g is the drive's own. The diagnosis reads the
training record only. The record with force pulses is then simulated with the nominal and the improved model.

Run it: `python examples/robot_drive_diagnosis.py FOLDER [PICTURE.png]`; FOLDER holds `DATA_EMPS.mat` and
`DATA_EMPS_PULSES.mat`. `... FOLDER loops` repeats the diagnosis with other springs and dampers.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.optimize import least_squares
from scipy.signal import butter, filtfilt, resample_poly

from estimation import BandRecording, channels_of
from millfrf.core.compilation import compiled
from millfrf.figures import COLOURS, house_style, new_figure
from millfrf.mismatch import StructureDiagnosis, diagnose, improved_model, predict
from modal_fit import ModalModel

Real = NDArray[np.float64]

STEP = 1e-3
"""s."""

KEPT = 20
"""The diagnosis reads every so many samples (50 Hz)."""

VIRTUAL = (2.0, 0.7)
"""Frequency (Hz) and damping ratio of the mode that the known spring and damper make of the nominal mass."""

PULSE_V = 1.0139
"""Motor command for each unit of ``pulses_N``: command minus controller follows the pulses with a correlation of
0.999998 and this slope; the stored number is 5.07 V cut to a whole one, not newtons."""

PUBLISHED = (95.1089, 203.5034, 20.3935, 1e-3, -3.1648)
"""M (kg), c (N s/m), F_c (N), smoothing velocity (m/s; 1 mm/s stands for a sign), offset (N): inverse-dynamics least
squares of the benchmark's authors (their Simulation_EMPS_Validation.m)."""


@dataclass(frozen=True)
class Record:
    """One record of 24.8 s at 1 kHz.

    Parameters
    ----------
    force, position, reference, pulses : (24841,)
        N, m, m, V.
    drive, proportional, derivative
        Gains: N/V, 1/s, V s/m.
    """

    force: Real
    position: Real
    reference: Real
    pulses: Real
    drive: float
    proportional: float
    derivative: float


@dataclass(frozen=True)
class Drive:
    """``M q'' + c q' + F_c tanh(q' / v0) + offset = F`` in kg, N s/m, N, m/s, N."""

    mass: float
    viscous: float
    friction: float
    smooth: float
    offset: float

    def numbers(self) -> tuple[float, float, float, float, float]:
        """In this order."""
        return self.mass, self.viscous, self.friction, self.smooth, self.offset


def read_record(path: Path) -> Record:
    """Read one of the two files."""
    data = {name: np.asarray(value, dtype=float).ravel() for name, value in loadmat(path).items() if name[0] != "_"}
    pulses = PULSE_V * data.get("pulses_N", np.zeros(len(data["t"])))
    gain = float(data["gtau"][0])
    return Record(gain * data["vir"], data["qm"], data["qg"], pulses, gain, float(data["kp"][0]), float(data["kv"][0]))


def motion(record: Record, cutoff: float = 20.0) -> tuple[Real, Real, Real]:
    """Velocity (m/s), acceleration (m/s^2) and force (N) below ``cutoff`` Hz, without phase."""
    filters = butter(4, 2 * cutoff * STEP)
    velocity = np.gradient(filtfilt(*filters, record.position), STEP)
    return velocity, np.gradient(velocity, STEP), filtfilt(*filters, record.force)


def by_inverse_dynamics(record: Record, friction: float = 0.0, smooth: float = 1e-3) -> Drive:
    """Mass, viscous friction and offset by least squares of ``F - F_c tanh(q' / v0)``, with F_c and v0 given."""
    velocity, acceleration, force = (each[100:-100] for each in motion(record))
    columns = np.column_stack([acceleration, velocity, np.ones_like(velocity)])
    rest = force - friction * np.tanh(velocity / smooth)
    mass, viscous, offset = np.linalg.lstsq(columns, rest, rcond=None)[0]
    return Drive(float(mass), float(viscous), friction, smooth, float(offset))


def known_loop(drive: Drive, mode: tuple[float, float] = VIRTUAL) -> tuple[float, float]:
    """Spring (N/m) and damper (N s/m) that make the nominal mass the virtual mode."""
    omega = 2 * np.pi * mode[0]
    return drive.mass * omega**2, 2 * mode[1] * omega * drive.mass - drive.viscous


def modal_model(drive: Drive, mode: tuple[float, float] = VIRTUAL) -> ModalModel:
    """The nominal mass in the known loop, as a mode."""
    pole = 2 * np.pi * mode[0] * complex(-mode[1], np.sqrt(1 - mode[1] ** 2))
    left = np.array([[1 / (drive.mass * 2j * pole.imag)]])
    return ModalModel(np.array([pole]), np.ones((1, 1), dtype=complex), left, ("TCP:+X",), ("TCP:+X",))


def as_trial(name: str, record: Record, loop: tuple[float, float]) -> BandRecording:
    """Outer force ``F + k q + d q'`` and position of a record, brought down to 50 Hz."""
    position = record.position - record.position[0]
    outer = record.force + loop[0] * position + loop[1] * motion(record)[0]
    both = resample_poly(np.column_stack([outer, position]), 1, KEPT, axis=0)
    return BandRecording(
        name,
        1 / STEP / KEPT,
        both[:, :1],
        both[:, 1:],
        channels_of("force", ["TCP:+X"], ["force"]),
        channels_of("displacement", ["TCP:+X"], ["position"]),
    )


def halves(trial: BandRecording) -> list[BandRecording]:
    """First and second half, so that one can be held out."""
    n = len(trial.force) // 2
    return [trial.part("first half", 0, n), trial.part("second half", n, 2 * n)]


def named_friction(found: StructureDiagnosis) -> tuple[float, float]:
    """Size (N) and smoothing velocity (m/s) of the friction that was found; nothing if none was."""
    for cause in found.details.final.hypothesis.causes:
        if cause.physics.name == "coulomb_friction":
            return float(cause.values[0]), float(cause.values[1])
    return 0.0, 1e-3


@compiled
def simulate(
    drive: tuple[float, float, float, float, float],
    force: Real,
    command: Real,
    gains: tuple[float, float],
    start: float,
) -> tuple[Real, Real]:
    """Position (m) and total force (N) from rest at ``start``; Heun's method, four steps a sample.

    ``force`` is added to what the controller asks for, ``gains[0] (gains[1] (command - q) - dq/dt)`` with the backward
    difference of two positions' mean, as the drive's own does; ``gains`` zero: the force alone drives.
    """
    mass, viscous, friction, smooth, offset = drive
    n, h = len(force), 1e-3 / 4
    position, total = np.zeros(n), np.zeros(n)
    q, v, last, before = start, 0.0, start, start
    for k in range(n):
        position[k] = q
        f = force[k] + gains[0] * (gains[1] * (command[k] - q) - (q - before) / 2e-3)
        before, last = last, q
        total[k] = f
        for _ in range(4):
            a = (f - offset - viscous * v - friction * np.tanh(v / smooth)) / mass
            w = v + h * a
            b = (f - offset - viscous * w - friction * np.tanh(w / smooth)) / mass
            q += h * (v + 0.5 * h * a)
            v += 0.5 * h * (a + b)
    return position, total


def open_loop(drive: Drive, record: Record) -> Real:
    """Position from the recorded motor force alone, m: nothing holds it, errors of velocity add up."""
    return simulate(drive.numbers(), record.force, record.reference, (0.0, 0.0), record.position[0])[0]


def closed_loop(drive: Drive, record: Record) -> tuple[Real, Real]:
    """Position and force from the reference and the pulses alone, with the drive's controller."""
    gains = (record.drive * record.derivative, record.proportional)
    return simulate(drive.numbers(), record.drive * record.pulses, record.reference, gains, record.position[0])


def refit(record: Record, start: Drive) -> Drive:
    """Mass, viscous friction, friction (if there is any) and offset by least squares of the open loop's position."""
    free = [0, 1, 4] if start.friction == 0 else [0, 1, 2, 4]
    first = np.array(start.numbers())

    def drive(x: Real) -> Drive:
        numbers = first.copy()
        numbers[free] = x
        return Drive(*(float(each) for each in numbers))

    answer = least_squares(
        lambda x: (open_loop(drive(x), record) - record.position)[::10], first[free], x_scale=np.abs(first[free])
    )
    return drive(answer.x)


def errors(drive: Drive, record: Record) -> dict[str, float]:
    """Open loop: position, mm RMS. Closed loop: position, um RMS, and force, per cent of the measured (20 Hz)."""
    position, force = closed_loop(drive, record)
    filters = butter(4, 2 * 20.0 * STEP)
    shown, measured = (filtfilt(*filters, each)[50:] for each in (force, record.force))
    return {
        "open loop, mm": 1e3 * float(np.sqrt(np.mean((open_loop(drive, record) - record.position) ** 2))),
        "closed loop, um": 1e6 * float(np.sqrt(np.mean((position - record.position)[50:] ** 2))),
        "closed loop force, %": 100 * float(np.linalg.norm(shown - measured) / np.linalg.norm(measured)),
    }


def picture(drives: dict[str, Drive], train: Record, test: Record) -> Figure:
    """Force that the rigid mass leaves over velocity, and the closed loop's error of force on the test record."""
    figure = new_figure(85)
    law, force = figure.subplots(1, 2, width_ratios=(2, 3))
    named = drives["named cause"]
    velocity, acceleration, motor = (each[200:-200:20] for each in motion(train))
    left = motor - named.mass * acceleration - named.viscous * velocity - named.offset
    law.plot(1e3 * velocity, left, ".", ms=2, color="#999999", label="measured, training record")
    line = np.linspace(velocity.min(), velocity.max(), 600)
    law.plot(1e3 * line, named.friction * np.tanh(line / named.smooth), color=COLOURS[1], label="named law")
    law.set(xlabel="velocity (mm/s)", ylabel="force (N)", title="what the rigid mass leaves out", ylim=(-35, 45))
    filters, part = butter(4, 2 * 20.0 * STEP), slice(1500, 11000)
    time = np.arange(len(test.force)) * STEP
    measured = filtfilt(*filters, test.force)
    for name, colour in (("rigid mass", COLOURS[2]), ("named cause", COLOURS[1])):
        rest = filtfilt(*filters, closed_loop(drives[name], test)[1]) - measured
        force.plot(time[part], rest[part], color=colour, lw=0.7, label=f"error, {name}")
    title = "test record, closed loop simulated from the reference"
    force.set(xlabel="time (s)", ylabel="motor force (N)", title=title, ylim=(-26, 34))
    for axes in (law, force):
        axes.legend(loc="upper left", fontsize=7)
    return figure


def study(folder: Path) -> tuple[StructureDiagnosis, dict[str, Drive], dict[str, float]]:
    """Diagnosis of the training record, drives before and after, and the tool's own relative error on the test."""
    train, test = (read_record(folder / name) for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"))
    rigid = by_inverse_dynamics(train)
    loop, nominal = known_loop(rigid), modal_model(rigid)
    diagnosis = diagnose(nominal, halves(as_trial("train", train, loop)))
    named = by_inverse_dynamics(train, *named_friction(diagnosis))
    drives = {
        "rigid mass": rigid,
        "rigid mass, refitted": refit(train, rigid),
        "named cause": named,
        "named cause, refitted": refit(train, named),
        "published": Drive(*PUBLISHED),
    }
    trial = as_trial("test", test, loop)
    models = {"rigid mass": nominal, "named cause": improved_model(diagnosis.details.final.hypothesis)}
    return diagnosis, drives, {name: predict(model, trial).total_error for name, model in models.items()}


def main(folder: Path, target: Path | None) -> None:
    result, drives, predicted = study(folder)
    print(f"verdict: {result.verdict}; share of the residual that depends on the signal: {result.leftover:.2f}")
    held = result.improvement
    print(f"held-out {held.held_out}: {held.before:.4f} before, {held.after:.4f} after, noise {held.noise_floor:.4f}")
    for cause in result.physics:
        numbers = ", ".join(
            f"{k} {v:.4g} +- {cause.standard_errors.get(k, 0):.1g}" for k, v in cause.parameters.items()
        )
        print(f"  {cause.name}: {numbers}; evidence {cause.evidence:.0f}")
    print(f"test record in the known loop's band: {100 * predicted['rigid mass']:.2f} % before, ", end="")
    print(f"{100 * predicted['named cause']:.2f} % after")
    train, test = (read_record(folder / name) for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"))
    for name, drive in drives.items():
        print(f"{name}: M {drive.mass:.2f} kg, c {drive.viscous:.1f} N s/m, F_c {drive.friction:.2f} N, ", end="")
        print(f"v0 {1e3 * drive.smooth:.1f} mm/s, offset {drive.offset:.2f} N")
        for label, record in (("train", train), ("test", test)):
            print(f"    {label}: " + ", ".join(f"{key} {value:.2f}" for key, value in errors(drive, record).items()))
    if target is not None:
        with house_style():
            picture(drives, train, test).savefig(target, dpi=150)


def other_loops(folder: Path) -> None:
    """What the diagnosis says with other springs and dampers around the same drive: an honest one would not matter."""
    train = read_record(folder / "DATA_EMPS.mat")
    rigid = by_inverse_dynamics(train)
    for mode in ((f, zeta) for f in (1.5, 2.0, 2.5, 3.0, 4.0) for zeta in (0.5, 0.7)):
        trials = halves(as_trial("train", train, known_loop(rigid, mode)))
        diagnosis = diagnose(modal_model(rigid, mode), trials)
        causes = ", ".join(f"{cause.name} {next(iter(cause.parameters.values())):.4g}" for cause in diagnosis.physics)
        errors = f"{diagnosis.improvement.before:.3f} -> {diagnosis.improvement.after:.3f}"
        print(f"{mode[0]:g} Hz, {mode[1]:g}: {diagnosis.verdict}: {causes or 'nothing'}; held-out error {errors}")


if __name__ == "__main__":
    if sys.argv[2:] == ["loops"]:
        other_loops(Path(sys.argv[1]))
    else:
        main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
