"""What does a linear model leave out of an aircraft with a payload on bolts? Answers beside plain and black-box fits.

The wing of an F-16 with a payload on bolts was shaken by the same periodic multisine of 2 to 15 Hz at two levels (Noel
& Schoukens, F-16 aircraft benchmark based on ground vibration test data, 2017, 4TU.ResearchData 12954911). The nominal
model is a linear fit to the lower level. The diagnosis reads the first five of eight periods of either level; the last
two of the upper level are predicted. Beside it stand models that know nothing of physics, fitted to the same periods.

Run it: `python examples/aircraft_diagnosis.py FOLDER [PICTURE.png]`; FOLDER holds `level_1.h5` and `level_3.h5`.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft
from scipy.optimize import least_squares

from estimation import BandRecording, linear_approximation, read_band_recording, steady_periods
from millfrf.figures import behaviour_figure
from millfrf.mismatch import StructureDiagnosis, diagnose, improved_model_of, predict
from modal_fit import ModalModel, fit_polyreference

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

EXCITED, SENSORS = ["EXC:+Z"], ["EXC:+Z", "WING:+Z", "PAYLOAD:+Z"]
BAND = (3.0, 11.0)
"""Hz. Compared, and all errors counted, in this band."""

PERIOD, TRAINED, TESTED = 8192, 5, 2
"""Samples of a period, periods read at each level, periods predicted."""

MORE_MODES = (6, 9, 12)
"""Modes of the least-squares fits: those of the nominal model, and more."""


@dataclass(frozen=True)
class Records:
    """Training records of the lower and the upper level, and their last periods for the test."""

    trained: tuple[BandRecording, BandRecording]
    tests: tuple[BandRecording, BandRecording]


def read_records(folder: Path) -> Records:
    """Periods for training and for the test; the test begins a period early, so that transients have rung out."""
    low, high = (read_band_recording(folder / f"level_{k}.h5", EXCITED, SENSORS, 400.0) for k in (1, 3))
    n = len(high.force)
    first = n - (TESTED + 1) * PERIOD
    return Records(
        (low.part("level_1", 0, TRAINED * PERIOD), high.part("level_3", 0, TRAINED * PERIOD)),
        (low.part("level_1, last", first, n), high.part("level_3, last", first, n)),
    )


def nominal_model(low: BandRecording) -> ModalModel:
    """Poly-reference fit to the FRF of the lower level."""
    frf = linear_approximation(steady_periods([low])).frf
    return fit_polyreference(replace(frf, covariance=None), BAND).model


def in_band(signal: Real, rate: float) -> Real:
    """The band's part of the last periods, (TESTED * PERIOD, n)."""
    spectrum = rfft(signal, axis=0)
    f = np.arange(len(spectrum)) * rate / len(signal)
    spectrum[(f < BAND[0]) | (f > BAND[1])] = 0
    return np.asarray(irfft(spectrum, n=len(signal), axis=0))


def error(predicted: Real, measured: Real, rate: float) -> float:
    """What is left in the band over the response, all sensors together, each in units of its own."""
    measured = measured[-TESTED * PERIOD :]
    left, whole = in_band(predicted - measured, rate), in_band(measured, rate)
    return float(np.sqrt(np.mean(np.mean(left**2, axis=0) / np.mean(whole**2, axis=0))))


def of_model(model: ModalModel, test: BandRecording) -> float:
    """Error of a modal model whose joints, if it has any, are simulated freely over four more periods before."""
    force = np.tile(test.force[:PERIOD], (TESTED + 5, 1))
    run = replace(test, force=force, response=np.ones((len(force), test.response.shape[1])))
    return error(predict(model, run).response[4 * PERIOD : (4 + TESTED) * PERIOD], test.response, test.rate)


def periodic_mean(record: BandRecording) -> tuple[Complex, Complex]:
    """Spectra of force and responses in the band's excited lines, mean of the periods after the first."""
    periods = len(record.force) // PERIOD
    both = np.concatenate([record.force, record.response], axis=1)[PERIOD : periods * PERIOD]
    spectra = rfft(both.reshape(periods - 1, PERIOD, -1).mean(axis=0), axis=0)
    return spectra[:, :1], spectra[:, 1:]


def basis(unknowns: Real, s: Complex) -> Complex:
    """Accelerances of modes of unit residues, and of what lies beyond the band, (n_lines, 2 n_modes + 2)."""
    n, unit = len(unknowns) // 2, abs(s[-1])
    w, zeta = np.exp(unknowns[:n]), np.exp(unknowns[n:])
    shares = 1 / (s[:, None] ** 2 + 2 * zeta * w * s[:, None] + w**2)
    rest = np.stack([(unit / s) ** 2, np.ones_like(s)], axis=1)
    return np.concatenate([w**2 * shares, w * s[:, None] * shares, rest], axis=1) * (s[:, None] / unit) ** 2


def least_squares_error(trained: list[BandRecording], test: BandRecording, nominal: ModalModel, modes: int) -> float:
    """Error of a linear model of a number of modes, by plain least squares on all lines of the records together.

    Residues are free and eliminated; further modes begin at places drawn three times, and the best fit counts.
    """
    f = np.arange(PERIOD // 2 + 1) * test.rate / PERIOD
    spectra = [periodic_mean(one) for one in trained]
    size = np.abs(spectra[-1][0][:, 0])
    lines = (f >= BAND[0]) & (f <= BAND[1]) & (size > 1e-3 * size.max())
    s = np.asarray(2j * np.pi * f[lines])
    unit = np.sqrt(np.mean(np.abs(spectra[-1][1][lines]) ** 2, axis=0))
    measured = np.concatenate([one[1][lines] / unit for one in spectra])

    def solved(unknowns: Real) -> tuple[Real, Complex]:
        design = np.concatenate([basis(unknowns, s) * one[0][lines] for one in spectra])
        both, target = np.concatenate([design.real, design.imag]), np.concatenate([measured.real, measured.imag])
        scale = np.linalg.norm(both, axis=0)
        numbers = np.linalg.lstsq(both / scale, target, rcond=None)[0]
        return (target - both / scale @ numbers).ravel(), numbers / scale[:, None]

    best = min((_fitted(solved, nominal, modes, seed) for seed in range(3)), key=lambda one: float(one.cost))
    force = rfft(test.force[-PERIOD:], axis=0)
    shown = np.zeros((len(f), len(unit)), dtype=complex)
    shown[lines] = (basis(best.x, s) * force[lines]) @ solved(best.x)[1] * unit
    return error(np.tile(irfft(shown, n=PERIOD, axis=0), (TESTED, 1)), test.response, test.rate)


def _fitted(solved: Any, nominal: ModalModel, modes: int, seed: int) -> Any:
    """Frequencies and damping ratios that leave least, begun with the nominal ones."""
    more = modes - len(nominal.poles)
    places = np.random.default_rng(seed).uniform(*BAND, max(more, 0))
    frequencies = 2 * np.pi * np.concatenate([nominal.natural_frequencies, places])
    start = np.log(np.concatenate([frequencies, nominal.damping_ratios, np.full(len(places), 0.02)]))
    n = len(frequencies)
    low = np.log(np.repeat([2 * np.pi * BAND[0] / 1.5, 5e-4], n))
    high = np.log(np.repeat([2 * np.pi * BAND[1] * 1.5, 0.5], n))
    scale = np.repeat([0.01, 0.3], n)
    return least_squares(lambda x: solved(x)[0], start, x_scale=scale, bounds=(low, high), max_nfev=40)


def repeated(trained: BandRecording, test: BandRecording) -> float:
    """Error of the mean of the upper level's training periods themselves: what noise and drift alone leave."""
    shown = irfft(periodic_mean(trained)[1], n=PERIOD, axis=0)
    return error(np.tile(shown, (TESTED, 1)), test.response, test.rate)


def study(folder: Path) -> tuple[Records, ModalModel, StructureDiagnosis]:
    """Records, nominal model, and what the diagnosis makes of them."""
    records = read_records(folder)
    nominal = nominal_model(records.trained[0])
    return records, nominal, diagnose(nominal, list(records.trained), band=BAND)


def errors_of(records: Records, nominal: ModalModel, found: StructureDiagnosis) -> dict[str, tuple[float, ...]]:
    """Errors on the last periods of either level, by model."""
    base, improved = found.details.base.hypothesis.model, improved_model_of(found)
    own = zip(records.trained, records.tests, strict=True)
    rows = {
        "nominal model": tuple(of_model(nominal, each) for each in records.tests),
        "refitted by the tool": tuple(of_model(base, each) for each in records.tests),
        "improved model of the tool": tuple(of_model(improved, each) for each in records.tests),
        "each level's own earlier periods": tuple(repeated(earlier, each) for earlier, each in own),
    }
    both = list(records.trained)
    for modes in MORE_MODES:
        for name, trained in (("both levels", both), ("upper level", both[1:])):
            left = tuple(least_squares_error(trained, each, nominal, modes) for each in records.tests)
            rows[f"least squares, {modes} modes, {name}"] = left
    return rows


def main(folder: Path, target: Path | None) -> None:
    records, nominal, result = study(folder)
    print(f"verdict: {result.verdict}; share of the residual that depends on the signal: {result.leftover:.2f}")
    for cause in result.physics:
        numbers = ", ".join(f"{key} {value:.4g}" for key, value in cause.parameters.items())
        print(f"  {cause.name} {dict(cause.location)}: {numbers}; evidence {cause.evidence:.0f}")
    stated = {cause.name for cause in result.physics}
    others = [each for each in result.candidates if each.stage == "fitted" and each.name not in stated]
    print("also fitted: " + ", ".join(f"{each.name} {each.evidence:.0f}" for each in others))
    print("equivalent: " + (", ".join(result.equivalents) or "nothing"))
    behaviour = result.details.behaviour
    assert behaviour is not None
    print(*(each.sentence for each in behaviour.modes), sep="\n")
    print(*behaviour.distortion, sep="\n")
    print(result.content["improved_model"]["sentence"])
    print("left of the lower and of the upper level's last periods:")
    for name, errors in errors_of(records, nominal, result).items():
        print(f"{name}: " + ", ".join(f"{100 * value:.1f} %" for value in errors))
    if target is not None:
        behaviour_figure(behaviour).savefig(target, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
