"""One FRF matrix from tests that hit or measured different points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from foundation import Band, InputError

from ..frf_matrix import Frf
from .agreement import Disagreement, disagreements_of
from .entries import Entries, solve_entries
from .places import blocks, check_whole, labels_of, turned
from .sums import TapSums

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
