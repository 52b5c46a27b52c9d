"""One FRF matrix from tests that hit or measured different points."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Band, Complex, DegreeOfFreedom, InputError, Real

from ..frf.frf_matrix import Frf
from .tap_spectra import TapSums


def labels_of(tests: Sequence[TapSums], axis: str) -> list[str]:
    """Each degree of freedom once, with the sign that it has where it comes first."""
    seen: dict[str, str] = {}
    for test in tests:
        for label in getattr(test, axis):
            seen.setdefault(unsigned(label)[0], label)
    return list(seen.values())


def unsigned(label: str) -> tuple[str, float]:
    """Node and axis without the sign, and the sign; a label that is no degree of freedom stays as it is."""
    if ":" not in label:
        return label, 1.0
    place = DegreeOfFreedom.parse(label)
    return f"{place.node}:{place.axis}", place.sign


def turned(test: TapSums, excitations: Sequence[str], responses: Sequence[str]) -> TapSums:
    """The test in the signs of the matrix."""
    known = {unsigned(label)[0]: label for label in excitations}
    forces, turn_f = _renamed(test.excitations, known)
    places, turn_x = _renamed(test.responses, {unsigned(label)[0]: label for label in responses})
    return replace(
        test,
        input_power=test.input_power * turn_f[:, None] * turn_f,
        cross=test.cross * turn_x[:, None] * turn_f,
        excitations=forces,
        responses=places,
    )


def _renamed(labels: Sequence[str], known: dict[str, str]) -> tuple[tuple[str, ...], Real]:
    names = tuple(known[unsigned(label)[0]] for label in labels)
    signs = [unsigned(old)[1] * unsigned(new)[1] for old, new in zip(labels, names, strict=True)]
    return names, np.array(signs)


def check_whole(tests: Sequence[TapSums], responses: Sequence[str], excitations: Sequence[str]) -> None:
    """Refuse a matrix with entries that no test measured."""
    measured = {
        (p, q)
        for test in tests
        for p in test.responses
        for q, count in zip(test.excitations, test.counts, strict=True)
        if count
    }
    missing = [f"{p} / {q}" for p in responses for q in excitations if (p, q) not in measured]
    if missing:
        more = f" and {len(missing) - 6} more" if len(missing) > 6 else ""
        raise InputError(
            f"no tap gives {', '.join(missing[:6])}{more} (response / point hit): {len(missing)} of "
            f"{len(responses) * len(excitations)} entries are missing; record them, or leave out the files or "
            "the channels (responses, --response) whose rows or columns are not whole"
        )


def blocks(
    tests: Sequence[TapSums], responses: Sequence[str], excitations: Sequence[str]
) -> Iterator[tuple[list[int], list[int], list[TapSums]]]:
    """Rows and columns that are solved together, with the tests that measured them."""
    for group in groups_of(tests):
        columns = [k for k, label in enumerate(excitations) if label in group]
        members = [test for test in tests if group & set(test.excitations)]
        together: dict[tuple[int, ...], list[int]] = {}
        for row, label in enumerate(responses):
            key = tuple(k for k, test in enumerate(members) if label in test.responses)
            together.setdefault(key, []).append(row)
        for key, rows in together.items():
            yield rows, columns, [members[k] for k in key]


def groups_of(tests: Sequence[TapSums]) -> list[set[str]]:
    """Excitations that are linked by tests that measured them at once."""
    groups: list[set[str]] = []
    for test in tests:
        linked = [group for group in groups if group & set(test.excitations)]
        groups = [group for group in groups if group not in linked]
        groups.append(set(test.excitations).union(*linked))
    return groups


DRIVEN = 1e-4
"""Power of the force over its largest, down to which an FRF is given: 40 dB."""

INDEPENDENT = 1e-4
"""Smallest over largest eigenvalue of the scaled force spectra of several inputs, as for H1."""


@dataclass(frozen=True)
class Entries:
    """Some rows and columns of an FRF matrix.

    Parameters
    ----------
    values : (n_frequencies, n_rows, n_columns), complex
        Values of the FRF in these rows and columns.
    coherence : (n_frequencies, n_rows, n_columns)
        Ordinary coherence, 0 to 1; NaN where it is not known.
    averages : (n_rows, n_columns), int
        Number of averages behind each entry.
    valid : (n_frequencies,), bool
        Whether the line has an FRF.
    """

    values: Complex
    coherence: Real
    averages: NDArray[np.int64]
    valid: NDArray[np.bool_]


def solve_entries(tests: Sequence[TapSums], responses: Sequence[str], excitations: Sequence[str]) -> Entries:
    """``S_xf S_ff^-1`` over all taps of tests that measured the same responses, with what it leaves unexplained."""
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
    explained = np.real(np.einsum("kpq,kpq->kp", values, cross.conj()))
    spare, own = int(counts.sum()) - n_columns, np.maximum(counts - 1, 0)
    coherence = np.full(values.shape, np.nan)
    if spare > 0:
        noise = np.maximum(output - explained, 0.0) / spare
        variance = noise[:, :, None] * np.real(np.einsum("kqq->kq", inverse))[:, None, :]
        size = np.abs(values) ** 2
        whole = size + own * variance
        known = valid[:, None, None] & (own > 0) & (whole > 0)
        np.divide(size, whole, out=coherence, where=known)
    return Entries(values, coherence, np.tile(counts, (n_rows, 1)), valid)


def _independent(power: Complex) -> NDArray[np.bool_]:
    own = np.real(np.einsum("kqq->kq", power))
    valid = np.asarray((own > DRIVEN * own.max(axis=0)).all(axis=1))
    if own.shape[1] > 1 and valid.any():
        scale = np.sqrt(own[valid])
        eigenvalues = np.linalg.eigvalsh(power[valid] / scale[:, :, None] / scale[:, None, :])
        valid[valid] = eigenvalues[:, 0] > INDEPENDENT * eigenvalues[:, -1]
    return valid


@dataclass(frozen=True)
class Disagreement:
    """An entry of the FRF matrix that two tests measured and that one of them sees differently.

    Parameters
    ----------
    test
        Name of the test that differs.
    response, excitation
        Degrees of freedom of the entry, ``node:direction``.
    share
        Energy of the difference from the merged entry over the energy of that entry, weighed by the force.
    """

    test: str
    response: str
    excitation: str
    share: float


def disagreements_of(tests: Sequence[TapSums], frf: Frf) -> tuple[Disagreement, ...]:
    """How far each test is from the matrix, for entries that more than one test measured with one force at a time."""
    n, found = len(frf.frequencies), []
    single = [test for test in tests if len(test.excitations) == 1]
    inside = frf.valid & (frf.frequencies > 0)
    if frf.band is not None:
        inside &= (frf.frequencies >= frf.band[0]) & (frf.frequencies <= frf.band[1])
    for test in single:
        force = np.real(test.input_power[:n, 0, 0])[inside]
        column = frf.excitations.index(test.excitations[0])
        for row, label in enumerate(test.responses):
            others = [each for each in single if each.excitations == test.excitations and label in each.responses]
            merged = frf.values[inside, frf.responses.index(label), column]
            energy = float(force @ np.abs(merged) ** 2)
            if len(others) > 1 and energy > 0:
                own = test.cross[:n, row, 0][inside] / np.where(force > 0, force, 1.0)
                share = float(force @ np.abs(own - merged) ** 2) / energy
                found.append(Disagreement(test.name, label, test.excitations[0], share))
    return tuple(sorted(found, key=lambda each: -each.share))


BAND = 1e-2
"""Power of the force over its largest, down to which a tap counts as driving: 20 dB."""


@dataclass(frozen=True)
class MergedTaps:
    """An FRF matrix merged from hammer tests, with what its tests disagree on.

    Parameters
    ----------
    frf
        FRF matrix with coherence, averages, band and the window's time constant.
    bands
        For each excitation, the lowest and highest frequency (Hz) around its strongest line without a drop by 20 dB;
        None where there is no such stretch.
    disagreements
        Entries that tests see differently, the worst first.
    """

    frf: Frf
    bands: dict[str, Band | None]
    disagreements: tuple[Disagreement, ...]


def merge_taps(tests: Sequence[TapSums], time_constant: float | None = None) -> MergedTaps:
    """Merge tests to ``H = S_xf S_ff^-1``, row by row over the tests that measured the row's response.

    A force that a test did not measure was not there: only one hammer hits. Taps of a point in several tests are
    averages of one entry. A sign in the direction of a point turns the sign of what was measured there.

    Ordinary coherence of an entry is ``|S_xf|^2 / (S_xx S_ff)``; where a recording holds several forces at once, it is
    the coherence that is left when the other forces' share is taken off both (Bendat & Piersol, Random Data, 4th ed.,
    section 7.3). It is not known where an entry rests on one tap.

    Parameters
    ----------
    tests
        Summed spectra of each test, on one frequency axis.
    time_constant : s
        Time constant of the exponential window; None: no such window.

    Raises
    ------
    InputError
        Entries that no test measured, responses of different quantities, or forces without common lines.
    """
    kinds = sorted({test.quantity for test in tests})
    if len(kinds) > 1:
        raise InputError(
            f"responses of different quantities ({', '.join(kinds)}); "
            "choose the channels of one (responses, --response)"
        )
    excitations, responses = labels_of(tests, "excitations"), labels_of(tests, "responses")
    signed = [turned(test, excitations, responses) for test in tests]
    check_whole(signed, responses, excitations)
    matrix = _matrix(signed, responses, excitations)
    if not all(test.grounded for test in tests):
        matrix.valid[tests[0].frequencies <= 0] = False
    if not matrix.valid.any():
        raise InputError(
            "the forces have no line in common on which each has power; hit with one tip at every point, or merge the "
            "points in groups"
        )
    bands = {label: _driven(signed, label) for label in excitations}
    frf = _frf(matrix, signed[0], tuple(responses), tuple(excitations))
    frf = replace(frf, band=_common(list(bands.values())), exponential_time_constant=time_constant)
    return MergedTaps(frf, bands, disagreements_of(signed, frf))


def _matrix(tests: Sequence[TapSums], responses: Sequence[str], excitations: Sequence[str]) -> Entries:
    """All entries; a line is valid where it is for each."""
    shape = (len(tests[0].frequencies), len(responses), len(excitations))
    values, coherence = np.zeros(shape, dtype=complex), np.full(shape, np.nan)
    averages, valid = np.zeros(shape[1:], dtype=np.int64), np.ones(shape[0], dtype=bool)
    for rows, columns, members in blocks(tests, responses, excitations):
        part = solve_entries(members, [responses[p] for p in rows], [excitations[q] for q in columns])
        entries = np.ix_(range(shape[0]), rows, columns)
        values[entries], coherence[entries] = part.values, part.coherence
        averages[np.ix_(rows, columns)] = part.averages
        valid &= part.valid
    return Entries(values, coherence, averages, valid)


def _frf(matrix: Entries, like: TapSums, responses: tuple[str, ...], excitations: tuple[str, ...]) -> Frf:
    """The matrix up to its last valid line."""
    last = int(np.flatnonzero(matrix.valid)[-1]) + 1
    valid, coherence = matrix.valid[:last], matrix.coherence[:last]
    multiple = None
    if len(excitations) == 1 and np.isfinite(coherence[valid]).all():
        multiple = np.where(valid[:, None], coherence[:, :, 0], 0.0)
    return Frf(
        like.frequencies[:last],
        np.where(valid[:, None, None], matrix.values[:last], 0.0),
        responses,
        excitations,
        like.quantity,
        like.unit,
        valid,
        multiple,
        coherence=coherence if np.isfinite(coherence).any() else None,
        averages=matrix.averages,
    )


def _driven(tests: Sequence[TapSums], label: str) -> Band | None:
    """The stretch around the force's strongest line in which it has a hundredth of that line's power."""
    f = tests[0].frequencies
    power = np.zeros(len(f))
    for test in tests:
        if label in test.excitations:
            k = test.excitations.index(label)
            power += np.real(test.input_power[:, k, k])
    power[f <= 0] = 0.0
    top = int(np.argmax(power))
    weak = np.flatnonzero(power < BAND * power[top])
    low = int(weak[weak < top].max(initial=-1)) + 1
    high = int(weak[weak > top].min(initial=len(power))) - 1
    return (float(f[low]), float(f[high])) if low < high else None


def _common(bands: Sequence[Band | None]) -> Band | None:
    """Frequencies (Hz) that all excitations drive."""
    known = [band for band in bands if band is not None]
    low, high = max((band[0] for band in known), default=0.0), min((band[1] for band in known), default=0.0)
    return (low, high) if low < high and len(known) == len(bands) else None
