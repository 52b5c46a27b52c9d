"""Choose how to fit by what was given: one FRF, or recordings."""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from estimation import read_frf
from foundation import InputError
from modal_fit import ModalFit, SubspaceFit

from ..file_kinds import FRF, RECORDING, kind_of
from ..gate import stored_doubts
from ..progress import Watch, silent
from .fit import MAX_ORDER, POLYREFERENCE, SUBSPACE, FitOptions, fit_model, fit_recordings


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
    if method is not None and method not in MAX_ORDER:
        raise InputError(f"unknown method {method!r}; use one of {', '.join(MAX_ORDER)}")
    kinds = {kind_of(file) for file in files}
    if kinds == {RECORDING}:
        options = options_of(method or SUBSPACE)
        return fit_recordings(files, options, watch), options
    if kinds == {FRF} and len(files) == 1:
        options = options_of(method or POLYREFERENCE)
        fit = fit_model(read_frf(files[0]), options, watch, Path(files[0]).name)
        return replace(fit, warnings=(*stored_doubts(files[0]), *fit.warnings)), options
    raise InputError(
        f"cannot fit {len(files)} file{'s' if len(files) != 1 else ''} of {' and '.join(sorted(kinds))}; "
        "give one FRF, or recordings"
    )
