"""Fields that tell a modal model or an FRF."""

from typing import Any

import numpy as np

from estimation import Frf
from modal_fit import ModalModel, frequency_and_damping_errors


def model_answer(model: ModalModel) -> dict[str, Any]:
    """Modes with their standard errors, degrees of freedom, quantity and band.

    Parameters
    ----------
    model
        A modal model; errors are null where it tells none.
    """
    errors = frequency_and_damping_errors(model)
    modes = []
    for r, (frequency, ratio) in enumerate(zip(model.natural_frequencies, model.damping_ratios, strict=True)):
        spread = (None, None) if errors is None else (errors[0][r], errors[1][r])
        modes.append(
            {
                "frequency_hz": frequency,
                "frequency_standard_error_hz": spread[0],
                "damping_ratio": ratio,
                "damping_ratio_standard_error": spread[1],
            }
        )
    return {
        "modes": modes,
        "quantity": model.quantity,
        "unit": model.unit,
        "responses": model.responses,
        "excitations": model.excitations,
        "band_hz": model.band,
    }


def frf_answer(frf: Frf) -> dict[str, Any]:
    """Degrees of freedom, lines, band, and how well each response is explained.

    Parameters
    ----------
    frf
        An FRF; the median of the multiple coherence over its valid lines is null where it tells none.
    """
    coherence = frf.multiple_coherence
    middle = None
    if coherence is not None and frf.valid.any():
        middle = np.median(coherence[frf.valid], axis=0)
    return {
        "quantity": frf.quantity,
        "unit": frf.unit,
        "responses": frf.responses,
        "excitations": frf.excitations,
        "lines": len(frf.frequencies),
        "valid_lines": frf.valid.sum(),
        "first_frequency_hz": frf.frequencies[0],
        "last_frequency_hz": frf.frequencies[-1],
        "band_hz": frf.band,
        "median_multiple_coherence": middle,
    }
