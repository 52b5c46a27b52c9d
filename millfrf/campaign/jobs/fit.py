"""The jobs `fit` and `calibrate`: the modal model of a set, at the sensor and at the tool tip."""

import warnings
from pathlib import Path

from millfrf.core import MillfrfWarning

from ...chain import POLYREFERENCE, FitOptions, write_calibration, write_fit
from ...face import calibrate as calibrate_to_tip
from ...face import fit as fit_model
from .estimate import FRF
from .sound_recordings import sound_files
from .work import Work, as_options

MODEL = "model.json"


def fit(work: Work, folder: Path) -> list[str]:
    """Modal model of a set, of its FRF or straight from its recordings.

    Raises
    ------
    InputError
        What is left of the set cannot be fitted.
    MillfrfError
        No stable pole was found.
    """
    options = FitOptions(**as_options(work.settings["options"]))
    paths, lines = ([work.need("estimate").folder / FRF], []) if options.method == POLYREFERENCE else sound_files(work)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MillfrfWarning)  # the result holds them
        found = fit_model(
            *paths,
            band=options.band,
            method=options.method,
            max_order=options.max_order,
            modes=options.n_modes,
            excitations=options.excitations,
            responses=options.responses,
            stream=options.stream,
        )
    write_fit(folder / MODEL, found, paths, options)
    return [*lines, *found.warnings]


def calibrate(work: Work, folder: Path) -> list[str]:
    """Carry the model of a set to the tool tip by two hammer FRFs.

    Raises
    ------
    InputError
        There is no model, or the three do not match.
    """
    tip, sensor = work.files
    model = work.need("fit").folder / MODEL
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MillfrfWarning)
        found = calibrate_to_tip(model, tip, sensor)
    write_calibration(folder / MODEL, found, [model, tip, sensor])
    return list(found.warnings)
