"""What does a linear model of the Silverbox leave out? The tool names it, then simulates the test part freely.

The Silverbox is an electronic vibrating system: V1 in, V2 out (Wigren & Schoukens, Three free data sets for development
and benchmarking in nonlinear system identification, European Control Conference 2013). The input is taken for a force,
the output for a displacement. A one-mode model is fitted to the multisine part, three of its ten realisations are
given to the diagnosis, and the arrowhead part, which it never saw, is simulated from rest from the input alone.

Run it: `python examples/silverbox_diagnosis.py FOLDER [PICTURE.png]`; FOLDER holds `SNLS80mV.mat`.
"""

import sys
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.optimize import least_squares
from scipy.signal import csd, welch

from estimation import BandRecording, channels_of, windowed_spectrum
from millfrf.figures import COLOURS, house_style, new_figure
from millfrf.mismatch import (
    Behaviour,
    Hypothesis,
    LabError,
    ModelShape,
    StructureDiagnosis,
    behaviour_of,
    diagnose,
    estimated_motion,
    fit,
    improved_model,
    linear_floor,
    predict,
)
from modal_fit import ModalModel

Real = NDArray[np.float64]

RATE = 1e7 / 2**14
"""Hz."""

FIRST, LENGTH = 40586, 8694
"""First sample and length of the multisine realisations, ten in all."""

TRAIN = slice(FIRST, FIRST + 9 * LENGTH)
PARTS = {
    "arrowhead": (slice(0, 40575), 150),
    "arrowhead without extrapolation": (slice(0, 32100), 150),
    "multisine": (slice(FIRST + 9 * LENGTH, 127400), 600),
}
"""Test parts and how many samples at their beginning do not count (nonlinear_benchmarks by G. Beintema: record from
sample 100, the first 50 of it for the initial state; the last realisation is no training data here)."""


SILENT, ARROW_BAND = 300, (20.0, 200.0)
"""Samples before the arrowhead swells, and the band in which its parts are refitted, Hz."""


@dataclass(frozen=True)
class Signals:
    """Input and output, V; the input's offset removed."""

    force: Real
    response: Real


def read_signals(folder: Path) -> Signals:
    """Read ``SNLS80mV.mat``, (131072,) each."""
    data = loadmat(folder / "SNLS80mV.mat")
    return Signals(data["V1"].ravel().astype(float), data["V2"].ravel().astype(float))


def linear_model(signals: Signals) -> tuple[ModalModel, float]:
    """One mode ``H = b / (w0^2 - w^2 + 2 i zeta w0 w)`` through H1 of the training part, and the input's offset, V.

    The means of input and output do not agree with H(0): the difference is an offset of the generator or its
    measurement, and would otherwise push the nonlinear system off its centre.
    """
    force, response = signals.force[TRAIN], signals.response[TRAIN]
    f, cross = csd(force, response, RATE, nperseg=8192)
    power = welch(force, RATE, nperseg=8192)[1]
    inside = (f > 5) & (f < 190)
    measured, weight, s = (cross / power)[inside], np.sqrt(power[inside]), 2j * np.pi * f[inside]

    def misfit(p: Real) -> Real:
        rest = (p[2] / (s**2 + 2 * p[1] * p[0] * s + p[0] ** 2) - measured) * weight
        return np.asarray(np.concatenate([rest.real, rest.imag]) / weight.max())

    omega, zeta, gain = least_squares(misfit, [2 * np.pi * 68, 0.05, 2e5], x_scale=[400, 0.05, 2e5]).x
    pole = omega * complex(-zeta, np.sqrt(1 - zeta**2))
    right, left = np.ones((1, 1), dtype=complex), np.array([[gain / (2j * pole.imag)]])
    model = ModalModel(np.array([pole]), right, left, ("TCP:+X",), ("TCP:+X",), unit="V/V")
    return model, float(force.mean() - response.mean() * omega**2 / gain)


def as_trial(name: str, signals: Signals, part: slice, silence: int = 0) -> BandRecording:
    """A piece of the record as a trial, with ``silence`` samples of zeros before and after."""
    force, response = (np.pad(signal[part], silence)[:, None] for signal in (signals.force, signals.response))
    channels = channels_of("force", ["TCP:+X"], ["input"]), channels_of("displacement", ["TCP:+X"], ["output"])
    return BandRecording(name, RATE, force, response, *channels)


def free_run(model: ModalModel, signals: Signals, part: slice) -> Real:
    """Output simulated from rest from the input alone, V."""
    silence = int(1.2 * RATE)  # the tool ramps forces over a second at either end
    return predict(model, as_trial("test", signals, part, silence)).response[silence:-silence, 0]


def free_run_errors(model: ModalModel, signals: Signals) -> dict[str, float]:
    """Root mean square error of the free run on each test part, mV."""
    return {
        name: 1e3 * float(np.sqrt(np.mean((free_run(model, signals, part) - signals.response[part])[skip:] ** 2)))
        for name, (part, skip) in PARTS.items()
    }


def study(folder: Path) -> tuple[Signals, ModalModel, StructureDiagnosis]:
    """Signals, nominal model, and what the diagnosis makes of three realisations."""
    raw = read_signals(folder)
    nominal, offset = linear_model(raw)
    signals = Signals(raw.force - offset, raw.response)
    pieces = [slice(FIRST + k * LENGTH, FIRST + (k + 1) * LENGTH) for k in (0, 3, 6)]
    trials = [as_trial(f"realisation {k + 1}", signals, piece) for k, piece in zip((0, 3, 6), pieces, strict=True)]
    return signals, nominal, diagnose(nominal, trials)


def by_level(signals: Signals, nominal: ModalModel) -> Behaviour:
    """What the mode does with the level: the arrowhead in five parts, each refitted alone."""
    ends = np.linspace(SILENT, PARTS["arrowhead"][0].stop, 6).astype(int)
    parts = [as_trial(f"part {k + 1}", signals, slice(a, b)) for k, (a, b) in enumerate(pairwise(ends.tolist()))]
    decay = float((-nominal.poles.real).min())
    lines = [windowed_spectrum(trial, ARROW_BAND, decay) for trial in parts]
    shape = ModelShape(nominal, LabError())
    return behaviour_of(fit(lines, Hypothesis(shape, np.zeros(shape.size))).hypothesis, lines)


def picture(signals: Signals, nominal: ModalModel, diagnosis: StructureDiagnosis) -> Figure:
    """Free-run error over the arrowhead, and the force that the residual requires over the deflection."""
    figure = new_figure(85)
    errors, law = figure.subplots(1, 2, width_ratios=(3, 2))
    part = PARTS["arrowhead"][0]
    time, measured = np.arange(part.stop) / RATE, signals.response[part]
    models = {"linear model": nominal, "with the named cause": improved_model(diagnosis.details.final.hypothesis)}
    errors.plot(time, 1e3 * measured, color="#bbbbbb", lw=0.4, label="measured")
    for (name, model), colour in zip(models.items(), (COLOURS[2], COLOURS[1]), strict=True):
        errors.plot(
            time, 1e3 * (free_run(model, signals, part) - measured), color=colour, lw=0.4, label=f"error, {name}"
        )
    errors.set(xlabel="time (s)", ylabel="output (mV)", title="arrowhead test, simulated from rest")
    final = diagnosis.details.final
    # a law of free form takes the place of the named one where the recordings prove that it is needed
    cause, axis = next((cause, cause.axis) for cause in final.hypothesis.causes if cause.axis is not None)
    linear = replace(final, hypothesis=replace(final.hypothesis, causes=()))
    floor = linear_floor(linear, list(diagnosis.details.recordings))
    motions = [estimated_motion(record, linear.hypothesis, axis) for record in floor.records]
    kept = slice(diagnosis.details.recordings[0].start, -int(2 * RATE))
    x, g = (np.concatenate([getattr(motion, name)[kept] for motion in motions]) for name in ("deflection", "force"))
    law.plot(1e3 * x[::7], 1e3 * g[::7], ".", ms=1, color="#999999", label="required by the residual")
    line = np.linspace(x.min(), x.max(), 400)
    force = cause.law()
    table = np.interp(line, np.linspace(-force.reach, force.reach, len(force.stiffness)), force.stiffness)
    law.plot(1e3 * line, 1e3 * table, color=COLOURS[1], label="fitted law")
    law.set(xlabel="deflection: output (mV)", ylabel="force: input (mV)", title="what the linear model leaves out")
    for axes in (errors, law):
        axes.legend(loc="upper left", fontsize=7)
    return figure


def main(folder: Path, target: Path | None) -> None:
    signals, nominal, diagnosis = study(folder)
    print(f"linear model: {nominal.natural_frequencies[0]:.2f} Hz, damping {100 * nominal.damping_ratios[0]:.2f} %")
    print(f"verdict: {diagnosis.verdict}; share of the residual that depends on the signal: {diagnosis.leftover:.2f}")
    for cause in diagnosis.physics:
        numbers = ", ".join(
            f"{k} {v:.4g} +- {cause.standard_errors.get(k, 0):.1g}" for k, v in cause.parameters.items()
        )
        print(f"  {cause.name}: {numbers}; evidence {cause.evidence:.0f}")
    after = improved_model(diagnosis.details.final.hypothesis)
    before_errors, after_errors = free_run_errors(nominal, signals), free_run_errors(after, signals)
    for name in PARTS:
        print(f"free run, {name}: {before_errors[name]:.2f} mV before, {after_errors[name]:.3f} mV after")
    behaviour = by_level(signals, nominal)
    print(f"without any law, arrowhead: {behaviour.sentence}")
    print("  " + ", ".join(f"{frequency:.2f} Hz" for frequency in behaviour.modes[0].frequencies))
    if target is not None:
        with house_style():
            picture(signals, nominal, diagnosis).savefig(target, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
