"""An FRF that is mostly noise by its own coherence, and that tells no errors, is doubted; none that tells them is."""

from dataclasses import replace

import numpy as np
import pytest

from estimation import Frf, FrfCovariance
from millfrf.gate import check_frf
from modal_fit import ModalModel
from replay_data import table_one_model

LINES = np.arange(10.0, 30.0, 0.1)


def tip(model: ModalModel | None = None) -> Frf:
    """Receptance of Table 1 at the tip, 10 to 30 Hz."""
    return (model or table_one_model()).frf(LINES)


def coherent(frf: Frf, value: float) -> Frf:
    return replace(frf, multiple_coherence=np.full(frf.values.shape[:2], value))


def test_low_coherence_without_errors_is_doubted() -> None:
    [doubt] = check_frf(coherent(tip(), 0.2), "tip.h5")
    assert doubt.startswith("TCP:+X, TCP:+Y, TCP:+Z: 100 % of the motion")
    assert "median 0.2" in doubt
    assert check_frf(coherent(tip(), 0.6)) == []
    assert check_frf(tip()) == []


def test_one_poor_response_is_named() -> None:
    frf = coherent(tip(), 0.95)
    assert frf.multiple_coherence is not None
    frf.multiple_coherence[:, 1] = 0.3
    [doubt] = check_frf(frf)
    assert doubt.startswith("TCP:+Y: 100 %")


def test_lines_without_motion_need_no_coherence() -> None:
    """Anti-resonances and lines beside the modes are incoherent in every measurement; energy decides."""
    frf = coherent(tip(), 0.95)
    assert frf.multiple_coherence is not None
    frf.multiple_coherence[(LINES < 15) | (LINES > 21)] = 0.05
    assert np.median(frf.multiple_coherence) < 0.1
    assert check_frf(frf) == []
    only_noise = replace(frf, band=(22.0, 30.0))
    [doubt] = check_frf(only_noise)
    assert "coherence is below 0.5" in doubt


@pytest.mark.parametrize("averages", [None, 1, 20])
def test_averages_with_the_coherence_of_entries_tell_the_errors(averages: int | None) -> None:
    frf = tip()
    poor = replace(frf, coherence=np.full(frf.values.shape, 0.2))
    if averages is not None:
        poor = replace(poor, averages=np.full(frf.values.shape[1:], averages))
    assert len(check_frf(poor)) == (0 if averages == 20 else 1)


def test_a_covariance_tells_them_too() -> None:
    frf = coherent(tip(), 0.2)
    matrices = np.broadcast_to(1e-16 * np.eye(3, dtype=complex), (len(LINES), 3, 3))
    assert check_frf(replace(frf, covariance=FrfCovariance(matrices, matrices))) == []


def test_entries_whose_coherence_is_not_known_are_not_judged() -> None:
    frf = tip()
    assert check_frf(replace(frf, coherence=np.full(frf.values.shape, np.nan))) == []
