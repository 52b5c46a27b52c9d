"""One FRF matrix from tests that hit or measured different points."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Band, Complex, DegreeOfFreedom, Index, InputError, Real, listed

from ..frf.frf_matrix import Frf
from ..frf.measured_blocks import missing_entries
from ..settings import HAMMER
from ..spectra.coherence_functions import powers, scaled_by
from .tap_spectra import TapSums


@dataclass(frozen=True)
class Disagreement:
    """An entry of the FRF matrix in which one test differs from the matrix merged from several tests."""

    test: str  # name of the test that differs
    response: str
    excitation: str
    share: float  # energy of the difference over the energy of the merged entry, both weighted by the force


@dataclass(frozen=True)
class MergedTaps:
    """An FRF matrix merged from hammer tests, with the entries on which its tests disagree."""

    frf: Frf  # FRF matrix with coherence, averages, band and the window's time constant
    # for each excitation, the lowest and highest frequency (Hz) around its strongest line without a drop by 20 dB; None
    # where there is no such range
    bands: dict[str, Band | None]
    disagreements: tuple[Disagreement, ...]  # entries that differ between tests, the worst first


def merge_taps(tests: Sequence[TapSums], time_constant: float | None = None) -> MergedTaps:
    """Merge tests to ``H = S_xf S_ff^-1``, each row from the tests that measured its response.

    A force that a test did not measure counts as zero, because there is only one hammer. Taps of the same point in
    several tests are averaged. The direction of a point has the sign with which it first appears in the tests.

    The ordinary coherence of an entry is ``|S_xf|^2 / (S_xx S_ff)``; where a recording has several forces at once, it
    is the coherence after the share of the other forces is subtracted from response and force (Bendat & Piersol, Random
    Data, 4th ed., section 7.3). An entry from a single tap has no known coherence. Tests in X, then in Y, with one
    accelerometer give a diagonal matrix, which states that its cross terms were not measured.

    Parameters
    ----------
    tests
        Summed spectra of each test, on one frequency axis.
    time_constant : s
        Time constant of the exponential window; None: no such window.

    Raises
    ------
    InputError
        Entries that no test measured, unless what was measured is whole blocks with a drive point each; responses of
        different quantities, or forces without common lines.
    """
    kinds = sorted({test.quantity for test in tests})
    if len(kinds) > 1:
        raise InputError(
            f"responses of different quantities ({', '.join(kinds)}); "
            "choose the channels of one (responses, --response)"
        )
    excitations, responses = (
        _labels_of([getattr(test, axis) for test in tests]) for axis in ("excitations", "responses")
    )
    aligned = [_with_signs_of(test, excitations, responses) for test in tests]
    measured = _measured(aligned, responses, excitations)
    frf = _frf(aligned, responses, excitations)
    # several forces in one test: those that a tap of this test did not hit give no entry
    frf = replace(frf, values=np.where(measured, frf.values, 0.0), measured=measured)
    bands = {label: _driven_band(aligned, label) for label in excitations}
    frf = replace(frf, band=_intersection(list(bands.values())), exponential_time_constant=time_constant)
    return MergedTaps(frf, bands, _disagreements(aligned, frf))


def _labels_of(axes: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return each degree of freedom of the tests once, with the sign of its first occurrence."""
    first: dict[str, str] = {}
    for labels in axes:
        for label in labels:
            first.setdefault(_unsigned(label)[0], label)
    return tuple(first.values())


def _unsigned(label: str) -> tuple[str, float]:
    """Return node and axis without the sign, and the sign; a label without a colon is returned as it is."""
    if ":" not in label:
        return label, 1.0
    dof = DegreeOfFreedom.parse(label)
    return f"{dof.node}:{dof.axis}", dof.sign


def _with_signs_of(test: TapSums, excitations: Sequence[str], responses: Sequence[str]) -> TapSums:
    """Turn the spectra of a test to the directions of the matrix, changing signs where they are opposite."""
    (forces, force_signs), (motions, motion_signs) = (
        _renamed(own, axis) for own, axis in ((test.excitations, excitations), (test.responses, responses))
    )
    return replace(
        test,
        input_power=test.input_power * force_signs[:, None] * force_signs,
        cross=test.cross * motion_signs[:, None] * force_signs,
        excitations=forces,
        responses=motions,
    )


def _renamed(labels: Sequence[str], axis: Sequence[str]) -> tuple[tuple[str, ...], Real]:
    by_place = {_unsigned(label)[0]: label for label in axis}
    names = tuple(by_place[_unsigned(label)[0]] for label in labels)
    return names, np.array([_unsigned(old)[1] * _unsigned(new)[1] for old, new in zip(labels, names, strict=True)])


def _measured(tests: Sequence[TapSums], responses: Sequence[str], excitations: Sequence[str]) -> NDArray[np.bool_]:
    """Return which entries the tests measured; refuse a matrix that is no set of whole blocks."""
    measured = np.zeros((len(responses), len(excitations)), dtype=bool)
    for test in tests:
        rows = [responses.index(label) for label in test.responses]
        columns = [
            excitations.index(label) for label, count in zip(test.excitations, test.counts, strict=True) if count
        ]
        measured[np.ix_(rows, columns)] = True
    missing = [f"{p} / {q}" for p, q in missing_entries(measured, responses, excitations)]
    if missing:
        raise InputError(
            f"no tap gives {listed(missing)} (response / point hit): {len(missing)} of {measured.size} entries are "
            "missing; record them, or leave out the files or the channels (responses, --response) whose rows or "
            "columns are not whole"
        )
    return measured


def _frf(tests: Sequence[TapSums], responses: tuple[str, ...], excitations: tuple[str, ...]) -> Frf:
    """Return the FRF matrix up to its last valid line; a line is valid where every entry is."""
    f = tests[0].frequencies
    shape = (len(f), len(responses), len(excitations))
    values, coherence = np.zeros(shape, dtype=complex), np.full(shape, np.nan)
    averages, valid = np.zeros(shape[1:], dtype=np.int64), np.ones(shape[0], dtype=bool)
    for rows, columns, members in _blocks(tests, responses, excitations):
        block = np.ix_(range(shape[0]), rows, columns)
        solved = _solved(members, [responses[p] for p in rows], [excitations[q] for q in columns])
        values[block], coherence[block], averages[np.ix_(rows, columns)], own_valid = solved
        valid &= own_valid
    if not all(test.grounded for test in tests):  # a sensor with a high-pass measures nothing at 0 Hz
        valid[f <= 0] = False
    if not valid.any():
        raise InputError(
            "the forces have no line in common on which each has power; hit with one tip at every point, or merge the "
            "points in groups"
        )
    end = int(np.flatnonzero(valid)[-1]) + 1
    valid, coherence = valid[:end], coherence[:end]
    multiple = None  # with one force the ordinary coherence is the multiple one
    if len(excitations) == 1 and np.isfinite(coherence[valid]).all():
        multiple = np.where(valid[:, None], coherence[:, :, 0], 0.0)
    return Frf(
        f[:end],
        np.where(valid[:, None, None], values[:end], 0.0),
        responses,
        excitations,
        tests[0].quantity,
        tests[0].unit,
        valid,
        multiple,
        coherence=coherence if np.isfinite(coherence).any() else None,
        averages=averages,
    )


def _blocks(
    tests: Sequence[TapSums], responses: Sequence[str], excitations: Sequence[str]
) -> Iterator[tuple[list[int], list[int], list[TapSums]]]:
    """Yield rows and columns of the matrix that are solved together, with the tests that measured them.

    Excitations are solved together where a test measured them at once, and rows where the same tests measured them.
    """
    groups: list[set[str]] = []
    for test in tests:
        linked = [group for group in groups if group & set(test.excitations)]
        groups = [group for group in groups if group not in linked]
        groups.append(set(test.excitations).union(*linked))
    for group in groups:
        columns = [k for k, label in enumerate(excitations) if label in group]
        members = [test for test in tests if group & set(test.excitations)]
        rows_of: dict[tuple[int, ...], list[int]] = {}
        for row, label in enumerate(responses):
            rows_of.setdefault(tuple(k for k, test in enumerate(members) if label in test.responses), []).append(row)
        rows_of.pop((), None)  # rows that no test of these excitations measured
        for numbers, rows in rows_of.items():
            yield rows, columns, [members[k] for k in numbers]


def _solved(
    tests: Sequence[TapSums], responses: Sequence[str], excitations: Sequence[str]
) -> tuple[Complex, Real, Index, NDArray[np.bool_]]:
    """Compute ``S_xf S_ff^-1`` over all taps of tests that measured the same responses.

    Returns values and coherence (n_frequencies, n_rows, n_columns), averages (n_rows, n_columns), and the valid lines.
    """
    n, n_rows, n_columns = len(tests[0].frequencies), len(responses), len(excitations)
    power, cross = np.zeros((n, n_columns, n_columns), complex), np.zeros((n, n_rows, n_columns), complex)
    output, counts = np.zeros((n, n_rows)), np.zeros(n_columns, dtype=np.int64)
    for test in tests:
        columns = [excitations.index(label) for label in test.excitations]
        rows = [test.responses.index(label) for label in responses]
        power[np.ix_(range(n), columns, columns)] += test.input_power
        cross[:, :, columns] += test.cross[:, rows]
        output += test.output_power[:, rows]
        counts[columns] += test.counts
    valid = _independent(power)
    inverse = np.zeros_like(power)
    inverse[valid] = np.linalg.inv(power[valid])
    values = cross @ inverse
    # coherence of H1 with the noise of the residual: each force takes a degree of freedom from the taps
    freedom, more_averages = int(counts.sum()) - n_columns, np.maximum(counts - 1, 0)
    coherence = np.full(values.shape, np.nan)
    if freedom > 0:
        explained = np.real(np.einsum("kpq,kpq->kp", values, cross.conj()))
        noise = np.maximum(output - explained, 0.0) / freedom
        variance = noise[:, :, None] * powers(inverse)[:, None, :]
        signal = np.abs(values) ** 2
        total = signal + more_averages * variance
        known = valid[:, None, None] & (more_averages > 0) & (total > 0)
        np.divide(signal, total, out=coherence, where=known)
    return values, coherence, np.tile(counts, (n_rows, 1)), valid


def _independent(power: Complex) -> NDArray[np.bool_]:
    """Return the lines on which every force has power, and several forces are independent."""
    own = powers(power)
    valid = np.asarray((own > HAMMER.driven * own.max(axis=0)).all(axis=1))
    if own.shape[1] > 1 and valid.any():
        eigenvalues = np.linalg.eigvalsh(scaled_by(power[valid], own[valid]))
        valid[valid] = eigenvalues[:, 0] > HAMMER.independent * eigenvalues[:, -1]
    return valid


def _driven_band(tests: Sequence[TapSums], label: str) -> Band | None:
    """Return the range around the force's strongest line in which the power is at least a hundredth of that line's."""
    f = tests[0].frequencies
    power = np.zeros(len(f))
    for test in tests:
        if label in test.excitations:
            k = test.excitations.index(label)
            power += np.real(test.input_power[:, k, k])
    power[f <= 0] = 0.0
    top = int(np.argmax(power))
    # the nearest weak line on either side bounds the band
    weak = np.flatnonzero(power < HAMMER.band * power[top])
    low = int(weak[weak < top].max(initial=-1)) + 1
    high = int(weak[weak > top].min(initial=len(power))) - 1
    return (float(f[low]), float(f[high])) if low < high else None


def _intersection(bands: Sequence[Band | None]) -> Band | None:
    """Return the band (Hz) that all excitations drive, or None."""
    known = [band for band in bands if band is not None]
    if len(known) < len(bands):
        return None
    low, high = max(band[0] for band in known), min(band[1] for band in known)
    return (low, high) if low < high else None


def _disagreements(tests: Sequence[TapSums], frf: Frf) -> tuple[Disagreement, ...]:
    """Compare each test that has a single force with the matrix, for entries that several tests measured."""
    n, disagreements = len(frf.frequencies), []
    single = [test for test in tests if len(test.excitations) == 1]
    inside = frf.valid & (frf.frequencies > 0)
    if frf.band is not None:
        inside &= (frf.frequencies >= frf.band[0]) & (frf.frequencies <= frf.band[1])
    for test in single:
        force = np.real(test.input_power[:n, 0, 0])[inside]
        column = frf.excitations.index(test.excitations[0])
        for row, label in enumerate(test.responses):
            n_tests = sum(other.excitations == test.excitations and label in other.responses for other in single)
            merged = frf.values[inside, frf.responses.index(label), column]
            energy = float(force @ np.abs(merged) ** 2)
            if n_tests > 1 and energy > 0:
                # H1 of this test alone, compared where its force has power
                own = test.cross[:n, row, 0][inside] / np.where(force > 0, force, 1.0)
                share = float(force @ np.abs(own - merged) ** 2) / energy
                disagreements.append(Disagreement(test.name, label, test.excitations[0], share))
    return tuple(sorted(disagreements, key=lambda disagreement: -disagreement.share))
