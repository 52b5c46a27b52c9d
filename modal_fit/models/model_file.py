"""Modal model files: JSON, format ``millfrf.modal_model`` version 1."""

import json
import os
from typing import Any

import numpy as np

from millfrf.core import Band, Complex, FileFormatError, InputError, Real, read_json, write_json

from .modal_model import BandSource, ModalModel, ModeErrors
from .out_of_band import Residuals

FORMAT, FORMAT_VERSION = "millfrf.modal_model", 1
_ERROR_SOURCES = ("noise", "points", "band", "terms")


def write_modal_model(path: str | os.PathLike[str], model: ModalModel) -> None:
    """Write a model to a JSON file, complex numbers as ``[re, im]``, vectors ``(n_modes, n_dof)``.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    content: dict[str, Any] = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "quantity": model.quantity,
        "unit": model.unit,
        "responses": list(model.responses),
        "excitations": list(model.excitations),
        "poles_rad_per_s": _pairs(model.poles),
        "right": _pairs(model.right),
        "left": _pairs(model.left),
    }
    if (terms := model.residuals) is not None:
        content["residuals"] = {"upper": terms.upper.tolist(), "lower": terms.lower.tolist()}
        if terms.poles is not None and terms.residues is not None:
            content["residuals"] |= {"poles_rad_per_s": _pairs(terms.poles), "residues": _pairs(terms.residues)}
    content |= _optional_fields(model)
    write_json(path, content)


def _optional_fields(model: ModalModel) -> dict[str, Any]:
    """Return the fields that are left out where a model does not have them."""
    content: dict[str, Any] = {}
    if model.covariance is not None:
        content["covariance"] = model.covariance.tolist()
    if model.errors is not None:
        content["mode_errors"] = _errors_to_json(model.errors)
    if model.delay:
        content["delay_s"] = model.delay
    if model.band is not None:
        content["band_hz"] = list(model.band)
    if model.sources:
        content["band_sources"] = [[band.low, band.high, band.source] for band in model.sources]
    if model.unmeasured_flexibility is not None:
        content["unmeasured_flexibility_m_per_n"] = model.unmeasured_flexibility
    if model.lowest_mode is not None:
        content["lowest_mode_hz"] = model.lowest_mode
    if model.measured is not None:
        content["measured"] = model.measured.tolist()
    if model.physics:
        content["physics"] = list(model.physics)
    return content


def read_modal_model(path: str | os.PathLike[str]) -> ModalModel:
    """Read a model that :func:`write_modal_model`, or another program, wrote in this format.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        Not JSON, edited after it was written, another format or version, a missing field, or shapes that disagree.
    """
    content = read_json(path, "a modal model made by fit")
    if content.get("format") != FORMAT:
        stated = content.get("format", "not given")
        raise FileFormatError(f"{path} is no modal model: its format is {stated!r}, expected {FORMAT!r}; run fit first")
    if content.get("format_version") != FORMAT_VERSION:
        raise FileFormatError(
            f"{path} has format_version {content.get('format_version')!r}, this program reads {FORMAT_VERSION}; "
            "use the program that wrote it"
        )
    try:
        return _model(content)
    except KeyError as error:
        raise FileFormatError(f"{path} lacks the field {error.args[0]}; fit again") from error
    except (TypeError, ValueError, IndexError, AttributeError) as error:
        raise FileFormatError(f"{path}: {_wrong_shape(content)}; fit again") from error
    except InputError as error:
        raise FileFormatError(f"{path}: {error}") from error


def _model(content: dict[str, Any]) -> ModalModel:
    responses, excitations = tuple(content["responses"]), tuple(content["excitations"])
    n_modes = len(content["poles_rad_per_s"])
    residuals, covariance = content.get("residuals"), content.get("covariance")
    flexibility, lowest = content.get("unmeasured_flexibility_m_per_n"), content.get("lowest_mode_hz")
    return ModalModel(
        poles=_complex("poles_rad_per_s", content, (n_modes,)),
        right=_complex("right", content, (n_modes, len(responses))),
        left=_complex("left", content, (n_modes, len(excitations))),
        responses=responses,
        excitations=excitations,
        quantity=str(content["quantity"]),
        unit=str(content["unit"]),
        residuals=None if residuals is None else _residuals(residuals, (len(responses), len(excitations))),
        covariance=None if covariance is None else _numbers("covariance", covariance).reshape(2 * (len(covariance),)),
        physics=tuple(content.get("physics", ())),
        delay=float(_numbers("delay_s", content.get("delay_s", 0.0))),
        band=_band(content),
        errors=_errors_from_json(content.get("mode_errors")),
        sources=tuple(
            BandSource(float(_numbers("band_sources", low)), float(_numbers("band_sources", high)), str(source))
            for low, high, source in content.get("band_sources", ())
        ),
        unmeasured_flexibility=None
        if flexibility is None
        else float(_numbers("unmeasured_flexibility_m_per_n", flexibility)),
        lowest_mode=None if lowest is None else float(_numbers("lowest_mode_hz", lowest)),
        measured=np.asarray(content["measured"], dtype=bool) if "measured" in content else None,
    )


def _residuals(stored: dict[str, Any], shape: tuple[int, int]) -> Residuals:
    return Residuals(
        _numbers("upper", stored["upper"]).reshape(shape),
        _numbers("lower", stored["lower"]).reshape(shape),
        _complex("poles_rad_per_s", stored, (-1,)) if "poles_rad_per_s" in stored else None,
        _complex("residues", stored, (-1, *shape)) if "residues" in stored else None,
    )


def _errors_to_json(errors: ModeErrors) -> dict[str, Any]:
    """Give pairs [frequency in Hz, damping ratio] of each mode; null where a source was not examined."""
    return {
        name: [[None if np.isnan(value) else value for value in pair] for pair in getattr(errors, name).tolist()]
        for name in _ERROR_SOURCES
    }


def _errors_from_json(stored: dict[str, Any] | None) -> ModeErrors | None:
    if stored is None:
        return None
    known = {name: [[np.nan if x is None else x for x in pair] for pair in stored[name]] for name in _ERROR_SOURCES}
    return ModeErrors(*(_numbers(name, pairs).reshape(-1, 2) for name, pairs in known.items()))


def _wrong_shape(content: dict[str, Any]) -> str:
    """Name the first field that holds no pairs in a regular array."""
    for name in ("poles_rad_per_s", "right", "left"):
        try:
            pairs = np.asarray(content.get(name), dtype=float)
        except (TypeError, ValueError):
            pairs = np.zeros(0)
        if pairs.shape[-1:] != (2,):
            return f"field {name} must hold pairs [re, im]"
    return "a field does not have the shape given by responses, excitations and poles_rad_per_s"


def _band(content: dict[str, Any]) -> Band | None:
    # older files do not state the band of the model, but the band of the fit in their provenance
    stored = content.get("band_hz") or (content.get("provenance") or {}).get("band_hz")
    if stored is None:
        return None
    low, high = _numbers("band_hz", stored).tolist()
    return low, high


def _pairs(array: Complex) -> list[Any]:
    return list(np.stack([array.real, array.imag], axis=-1).tolist())


def _complex(name: str, content: dict[str, Any], shape: tuple[int, ...]) -> Complex:
    pairs = _numbers(name, content[name]).reshape(*shape, 2)
    return np.asarray(pairs[..., 0] + 1j * pairs[..., 1])


def _numbers(name: str, stored: Any) -> Real:
    """Return the array of a field; its numbers are numbers in the file, since numpy takes true for 1."""
    values = np.asarray(stored, dtype=object).ravel().tolist()
    wrong = [value for value in values if type(value) not in (int, float, list)]  # list: of a ragged array
    if wrong:
        raise InputError(f"field {name} holds {json.dumps(wrong[0])[:40]}, which is no number; fit again")
    return np.asarray(stored, dtype=float)
