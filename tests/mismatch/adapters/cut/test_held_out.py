"""Errors on blocks that were not fitted, against sums over single blocks."""

import numpy as np
import pytest
from small_cut import small_cut, stated

from millfrf.mismatch.cut.comparison import fit_halves, held_out_misfits, held_out_powers, improvement, lowers
from millfrf.mismatch.cut.fitting import fit_cut
from millfrf.mismatch.cut.settings import CUT

TRUTH = stated(runout=[12e-6])
CUT_OF_TRUTH = small_cut(TRUTH)


def test_each_block_is_judged_by_the_fit_that_did_not_see_it() -> None:
    halves = fit_halves(CUT_OF_TRUTH, TRUTH, ("runout",))
    blocks = CUT_OF_TRUTH.spectra[0].blocks
    even, odd = (fit_cut(CUT_OF_TRUTH, TRUTH, ("runout",), part=slice(k, None, 2)) for k in (0, 1))
    expected = [odd.block_misfits[0][k] for k in range(0, blocks, 2)]
    expected += [even.block_misfits[0][k] for k in range(1, blocks, 2)]
    order = [*range(1, blocks, 2), *range(0, blocks, 2)]
    result = dict(zip(order, held_out_misfits(halves), strict=True))
    np.testing.assert_allclose(
        [result[k] for k in range(1, blocks, 2)], [even.block_misfits[0][k] for k in range(1, blocks, 2)]
    )
    assert sorted(held_out_misfits(halves)) == pytest.approx(sorted(expected))


def test_powers_of_blocks_are_those_of_the_residual() -> None:
    halves = fit_halves(CUT_OF_TRUTH, TRUTH, ())
    spectra = CUT_OF_TRUTH.spectra[0]
    total = 0.0
    for fitted, first in zip(halves, (1, 0), strict=True):
        rest = spectra.measured - CUT_OF_TRUTH.predicted(0, fitted.hypothesis)
        total += sum(float(np.sum(np.abs(rest[k]) ** 2)) for k in range(first, spectra.blocks, 2))
    assert held_out_powers(CUT_OF_TRUTH, halves).sum() == pytest.approx(total)


def test_the_true_cause_lowers_the_error_to_the_noise_and_an_absent_one_does_not() -> None:
    start = stated()
    nominal = fit_halves(CUT_OF_TRUTH, start, (), refit=False)
    base = fit_halves(CUT_OF_TRUTH, start, ())
    true = fit_halves(CUT_OF_TRUTH, start, ("runout",))
    assert lowers(CUT_OF_TRUTH, base, true, CUT.proof)
    gain = improvement(CUT_OF_TRUTH, nominal, base, true, CUT.proof)
    assert gain.after == pytest.approx(gain.noise_floor, rel=0.05)
    assert gain.interval[0] <= gain.after / gain.before <= gain.interval[1]
    assert gain.evidence == pytest.approx(float(np.sum(held_out_misfits(base) - held_out_misfits(true))))
    silent = small_cut(stated())
    without, absent = (fit_halves(silent, stated(), names) for names in ((), ("process_damping",)))
    assert not lowers(silent, without, absent, CUT.proof)
