"""Stacking of tests: spectra summed, for the least-squares FRF over all of them (Eq. 12 in its summed form)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from foundation import InputError

from .spectral_matrix import CrossSpectra
from .windows import effective_averages


def check_stackable(tests: Sequence[CrossSpectra]) -> None:
    """Refuse tests that cannot be stacked.

    Raises
    ------
    InputError
        No test, or tests that differ in sample rate, settings or channels; the message shows both values.
    """
    if not tests:
        raise InputError("no test to stack; give at least one recording")
    first = tests[0]
    for number, test in enumerate(tests[1:], start=2):
        if test.sample_rate != first.sample_rate:
            raise InputError(
                f"test {number} was sampled at {test.sample_rate:g} Hz, test 1 at {first.sample_rate:g} Hz; "
                "stack tests of one sample rate"
            )
        if test.settings != first.settings:
            raise InputError(f"test {number} was made with {test.settings}, test 1 with {first.settings}; use one")
        for mine, theirs in ((first.excitations, test.excitations), (first.responses, test.responses)):
            names = [[c.name + " " + c.degree_of_freedom for c in channels] for channels in (mine, theirs)]
            if names[0] != names[1]:
                raise InputError(f"test {number} has channels {names[1]}, test 1 has {names[0]}; stack equal set-ups")


def sum_tests(tests: Sequence[CrossSpectra]) -> CrossSpectra:
    """Sum spectra over tests, each weighted by its number of segments.

    ``H = (sum S_xf)(sum S_ff)^-1`` from the result is the least-squares FRF over all tests when their noise is
    equal; the paper's Eq. 12 sets them side by side instead (:func:`h1_side_by_side`).

    Raises
    ------
    InputError
        Tests that ``check_stackable`` refuses.
    """
    check_stackable(tests)
    n_segments = sum(test.n_segments for test in tests)

    def mean(name: str) -> np.ndarray:
        return np.asarray(sum(test.n_segments * getattr(test, name) for test in tests) / n_segments)

    return replace(
        tests[0],
        input_spectra=mean("input_spectra"),
        cross_spectra=mean("cross_spectra"),
        output_spectra=mean("output_spectra"),
        n_segments=n_segments,
        effective_averages=sum(test.effective_averages for test in tests),
        n_tests=sum(test.n_tests for test in tests),
        n_excluded=sum(test.n_excluded for test in tests),
    )


def join_parts(parts: Sequence[CrossSpectra]) -> CrossSpectra:
    """Put spectra of consecutive parts of one recording together: the spectra of the whole, to rounding.

    Means over segments are weighted by their number, so that ``S = sum_k n_k S_k / sum_k n_k``. The overlap of
    segments across a seam counts as it does elsewhere.

    Raises
    ------
    InputError
        Parts that ``check_stackable`` refuses.
    """
    total = sum_tests(parts)
    averages = effective_averages(total.settings, total.n_segments)
    return replace(total, effective_averages=averages, n_tests=parts[0].n_tests)
