"""Picked poles: from a file into a fit, and the candidates that a picker starts from."""

import os
from collections.abc import Sequence
from pathlib import Path

from estimation import Frf
from millfrf.core import InputError
from modal_fit import ModalFit, candidate_groups, fit_picked_poles, read_picked_poles, write_pole_candidates

from ...file_kinds import FRF, kind_of
from ...provenance import sources, versions
from .fit_options import FitOptions, chart_to_json


def check_picking(options: FitOptions) -> None:
    """Refuse options that contradict a picked fit, before anything is computed.

    Raises
    ------
    InputError
        A count of modes beside picked poles, or a refinement of an automatic fit, which is refined anyway.
    """
    if options.poles is not None and options.n_modes is not None:
        raise InputError(f"--poles names the modes, --modes {options.n_modes} a number of them; give one of the two")
    if options.refine and options.poles is None:
        raise InputError("--refine is of picked poles; an automatic fit is refined anyway: leave it out")


def check_candidates(path: Path, out: Path, poles: Path | None, files: Sequence[Path]) -> None:
    """Refuse a file of candidates that cannot be made or written, before anything is computed.

    Raises
    ------
    InputError
        Candidates of a fit that was picked or that is of recordings, the name of another file, or a name that cannot be
        written.
    """
    if poles is not None:
        raise InputError("--candidates offers what an automatic fit finds; leave --poles out")
    if kind_of(files[0]) != FRF:
        raise InputError("--candidates are poles of an FRF; estimate one from these recordings first")
    if path.resolve() == out.resolve():
        raise InputError(f"{path} is the model of --out; choose another file for --candidates")
    if path.suffix.lower() != ".json" or not path.parent.is_dir():
        raise InputError(f"cannot write {path}: give --candidates a name that ends in .json, in a folder that exists")


def fit_picked(frf: Frf, options: FitOptions) -> ModalFit:
    """Fit exactly the poles that ``options.poles`` names.

    Raises
    ------
    InputError
        A file that names no usable poles, or poles that the band does not hold.
    """
    assert options.poles is not None
    poles = read_picked_poles(options.poles)
    return fit_picked_poles(frf, options.band, poles, refine=options.refine, max_order=options.max_order)


def write_candidates(path: str | os.PathLike[str], fit: ModalFit, frf: str | os.PathLike[str]) -> int:
    """Write the groups of an automatic fit for a picker; returns how many there are."""
    groups = candidate_groups(fit)
    made = {"step": "candidates", "sources": sources([frf]), "versions": versions()}
    write_pole_candidates(path, groups, fit.band, chart_to_json(fit.chart), made)
    return len(groups)


def picked_in_words(fit: ModalFit, options: FitOptions) -> str:
    """One line on what became of picked poles."""
    assert options.poles is not None
    how = "refined from there" if options.refine else "kept as they are, vectors and residuals fitted"
    return f"{len(fit.model.poles)} poles picked in {Path(options.poles).name}, {how}"
