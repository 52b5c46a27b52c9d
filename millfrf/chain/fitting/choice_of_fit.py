"""Choose how to fit by what was given: one FRF, or recordings."""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from estimation import read_frf
from foundation import InputError
from modal_fit import ModalFit, SubspaceFit

from ...file_kinds import FRF, RECORDING, kind_of
from ...gate import stored_doubts
from ...progress import Watch, silent
from .fit import fit_model, fit_recordings
from .fit_options import METHODS, POLYREFERENCE, SUBSPACE, FitOptions

Fit = TypeVar("Fit", ModalFit, SubspaceFit)


def fit_files(
    files: Sequence[str | os.PathLike[str]],
    method: str | None,
    options_of: Callable[[str], FitOptions],
    watch: Watch = silent,
) -> tuple[ModalFit | SubspaceFit, FitOptions]:
    """Fit one FRF file or all recordings; returns the fit and the options it was made with.

    Parameters
    ----------
    files
        One FRF file, or recordings.
    method
        Name, or None: by what the files are.
    options_of
        Options of a method.

    Raises
    ------
    InputError
        An unknown method, files of mixed kinds, several FRFs, or a method that does not fit the files.
    """
    if method is not None and method not in METHODS:
        raise InputError(f"unknown method {method!r}; use one of {', '.join(METHODS)}")
    kinds = {kind_of(file) for file in files}
    if kinds == {RECORDING}:
        options = options_of(method or SUBSPACE)
        return _counted(fit_recordings(files, options, watch), options), options
    if kinds == {FRF} and len(files) == 1:
        options = options_of(method or POLYREFERENCE)
        fit = fit_model(read_frf(files[0]), options, watch, Path(files[0]).name)
        fit = _counted(fit, options)
        return replace(fit, warnings=(*stored_doubts(files[0]), *fit.warnings)), options
    raise InputError(
        f"cannot fit {len(files)} file{'s' if len(files) != 1 else ''} of {' and '.join(sorted(kinds))}; "
        "give one FRF, or recordings"
    )


def _counted(fit: Fit, options: FitOptions) -> Fit:
    """The fit, with a warning where it has fewer modes than were asked for."""
    asked, found = options.n_modes, len(fit.model.poles)
    if asked is None or found >= asked:
        return fit
    doubt = f"{asked} modes were asked for, {found} were found in {fit.band[0]:g} to {fit.band[1]:g} Hz"
    return replace(fit, warnings=(*fit.warnings, doubt))
