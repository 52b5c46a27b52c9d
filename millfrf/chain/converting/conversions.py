"""Kind of a conversion by its files and its mapping: recordings, FRFs, modal models, a geometry."""

import datetime
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path

from acquisition import convert as convert_recording
from estimation import import_frf, is_frf_mapping, load_frf_mapping, looks_like_frf
from millfrf.core import InputError

from ...gate import doubts_of_rate
from ...provenance import made
from .convert_uff import UFF_SUFFIXES, Told, convert_uff, is_uff_conversion, write_imported

FRF_SUFFIXES = (".h5", ".hdf5", *UFF_SUFFIXES)


def convert_files(
    sources: Sequence[Path],
    target: Path,
    mapping: Path | None,
    progress: Callable[[int], None] | None = None,
    span: tuple[float, float] | None = None,
) -> tuple[list[Path], Told]:
    """Convert one file, or several that make one FRF matrix.

    Parameters
    ----------
    sources
        Files to read.
    target
        File to write.
    mapping
        TOML with ``channels`` (a recording) or ``[frf]`` (FRFs); None: the files say it themselves.
    progress
        Called with the number of samples written so far, for recordings.
    span : s
        First and last time of a recording to keep, counted from its first sample; None: all of it.

    Returns
    -------
    list of Path, Told
        The files written, and what was inferred or may be doubted.

    Raises
    ------
    InputError
        Files that cannot be used together or at all; nothing is written.
    """
    if span is not None and (is_frf_conversion(sources, mapping) or is_uff_conversion(sources[0], target)):
        raise InputError("--span cuts a part out of a recording; leave it out for other files")
    if is_frf_conversion(sources, mapping):
        found = import_frf(sources, None if mapping is None else load_frf_mapping(mapping))
        return [target], write_imported(target, found, sources)
    if len(sources) > 1:
        raise InputError(
            f"{len(sources)} files to read: only FRFs are merged; convert the others one by one, or give a mapping "
            "with [frf] and [[entries]]"
        )
    if mapping is None and is_uff_conversion(sources[0], target):
        return [target], convert_uff(sources[0], target)
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    origin = made("convert", [sources[0], *([] if mapping is None else [mapping])], {"span_s": span, "at": now})
    written = convert_recording(sources[0], target, mapping, progress=progress, span=span, provenance=origin)
    doubts = tuple(doubt for path in written for doubt in doubts_of_rate(path))
    return written, Told((), doubts)


def is_frf_conversion(sources: Sequence[Path], mapping: Path | None) -> bool:
    """Say whether FRFs of other programs are read: the mapping says so, or without one the files leave no doubt."""
    if mapping is not None:
        return _is_about_frfs(mapping)
    if len(sources) > 1:
        return all(path.suffix.lower() in UFF_SUFFIXES for path in sources) or any(map(looks_like_frf, sources))
    return looks_like_frf(sources[0])


def _is_about_frfs(mapping: Path) -> bool:
    try:
        return is_frf_mapping(tomllib.loads(mapping.read_text(encoding="utf-8")))
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError):  # whoever reads it next says so in one line
        return False
