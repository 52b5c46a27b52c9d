"""`import_frf`: FRFs of other programs' files, of any format, as one matrix."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from foundation import InputError

from .apart import entries_of, parts_of
from .entries import ImportedFrf, assembled
from .frf_mapping import FrfMapping
from .matrix import matrix_entries
from .single_frfs import single_frfs
from .sources import ArraySource, FrfSource, open_source
from .text_table import SUFFIXES as TEXT_SUFFIXES
from .uff.frfs import UffChoice, import_uffs

UFF_SUFFIXES = (".uff", ".unv")
_TELLING = (*TEXT_SUFFIXES, ".npz", ".mat")


def import_frf(files: Sequence[str | os.PathLike[str]], mapping: FrfMapping | None = None) -> ImportedFrf:
    """Read FRFs from UFF, MAT, NPZ, NPY, HDF5, CSV or text files into one matrix.

    Several files make one matrix: those of a roving hammer or a roving sensor, one FRF or one reference each.

    Parameters
    ----------
    files
        One or more, all UFF or none.
    mapping
        What the files do not say: degrees of freedom, unit, columns, axes. UFF files need none as a rule.

    Returns
    -------
    ImportedFrf
        In SI units, for ``exp(+i w t)``.

    Raises
    ------
    InputError
        Something that nobody says; the message says what to write.
    FileFormatError
        Damaged files, entries that are missing or given twice, axes that differ, values that are not finite.
    """
    paths = [Path(file) for file in files]
    if not paths:
        raise InputError("no file to read FRFs from; give one or more")
    mapping = mapping or FrfMapping()
    uff = [path.suffix.lower() in UFF_SUFFIXES for path in paths]
    if any(uff) and not all(uff):
        raise InputError("UFF files and others are given together; convert them apart")
    found = import_uffs(paths, _choice(paths, mapping)) if all(uff) else _by_parts(paths, mapping)
    tau = mapping.frf.exponential_time_constant_s
    frf = found.frf if tau is None else replace(found.frf, exponential_time_constant=tau)
    return replace(found, frf=frf)


def looks_like_frf(path: str | os.PathLike[str]) -> bool:
    """Whether a text's headings or a file's arrays are without doubt those of FRFs.

    Not asked of HDF5 files: those without a mapping are made here.
    """
    file = Path(path)
    if file.suffix.lower() not in _TELLING:
        return False
    try:
        return len(set(open_source(file).roles()) - {"coherence"}) > 1
    except InputError:
        return False


def _by_parts(paths: Sequence[Path], mapping: FrfMapping) -> ImportedFrf:
    sources = [open_source(path, mapping.csv) for path in paths]
    if not mapping.entries and not mapping.frf.listed and len(sources) == 1 and _is_matrix(sources[0], mapping):
        parts = parts_of(sources[0], mapping)
        entries, told = matrix_entries(parts)
        inferred = tuple(f"{paths[0].name}: {text}" for text in (*parts.inferred, *told))
        return ImportedFrf(assembled(entries, parts.unit.quantity, parts.unit.unit), inferred)
    entries, unit, told = entries_of(sources, mapping)
    return ImportedFrf(assembled(entries, unit.quantity, unit.unit), told)


def _is_matrix(source: FrfSource, mapping: FrfMapping) -> bool:
    """Arrays, unless one response and one excitation say that it is a single FRF."""
    single = len(mapping.frf.responses) == len(mapping.frf.excitations) == 1
    return isinstance(source, ArraySource) and not (single and mapping.frf.axes is None)


def _choice(paths: Sequence[Path], mapping: FrfMapping) -> UffChoice:
    table = mapping.frf
    if table.given or table.listed or table.frequency or table.axes:
        raise InputError(
            f"{paths[0]}: a UFF file says itself where its numbers lie; leave columns and axes out of [frf]"
        )
    frfs = single_frfs(mapping)
    if any(entry.given for entry in frfs) or any(entry.record is None for entry in frfs):
        raise InputError(f"{paths[0]}: entries of a UFF file are named by record (place of the data set), nothing else")
    if mapping.entries and len(paths) > 1:
        raise InputError("entries by record go with one UFF file; convert the files one by one")
    places = {entry.record or 0: (entry.response, entry.excitation) for entry in frfs}
    return UffChoice(
        table.quantity, table.unit, table.responses, table.excitations, places or None, table.conjugate, table.averages
    )
