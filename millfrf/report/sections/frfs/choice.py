"""Choice of what is drawn of an FRF: its quantity, its frequency axis, the band of its model."""

from estimation import Frf, to_receptance
from millfrf.figures import coherent_lines
from modal_fit import ModalModel

from ...collection import SourceFile

Band = tuple[float, float]


def shown_frf(frf: Frf, model: ModalModel | None) -> Frf:
    """As a receptance where a model of one is drawn over it, else as it was measured."""
    return to_receptance(frf) if model is not None and model.quantity == "receptance" else frf


def knows(model: ModalModel, frf: Frf) -> bool:
    """Say whether a model has the unit and some responses of an FRF."""
    return model.unit == frf.unit and bool(set(model.responses) & set(frf.responses))


def band_of(file: SourceFile) -> Band | None:
    """Band of the fit behind a model, Hz; None where its file does not say."""
    stored = file.provenance.get("band_hz")
    return None if not stored else (float(stored[0]), float(stored[1]))


def axis_of(frf: Frf, fit_band: Band | None) -> Band:
    """The fit's band widened by a fifth of its width (downwards to half at most), or all lines that show the structure.

    Far below the band a receptance made of accelerations is nothing but noise over w^2.
    """
    valid = frf.frequencies[coherent_lines(frf) & (frf.frequencies > 0)]
    first, last = (float(valid[0]), float(valid[-1])) if len(valid) else (0.0, float(frf.frequencies[-1]))
    if fit_band is None:
        return first, last
    room = 0.2 * (fit_band[1] - fit_band[0])
    return max(first, fit_band[0] - room, fit_band[0] / 2), min(last, fit_band[1] + room)
