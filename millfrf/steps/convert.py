"""Step ``convert``: files of other programs into recordings, FRFs, models and geometries, and back."""

import datetime
import json
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from acquisition import SUFFIXES as CAN_LOGS
from acquisition import Recording, add_can_log, uff_function_types
from acquisition import convert as convert_recording
from estimation import (
    ImportedFrf,
    import_frf,
    import_geometry,
    is_frf_mapping,
    load_frf_mapping,
    looks_like_frf,
    read_frf,
    write_frf,
    write_frf_uff,
    write_geometry,
)
from millfrf.core import PLACED, InputError, listed, notices_to, refuse_replacing, writing_whole_file
from millfrf.core.progress import progress
from millfrf.core.provenance import add_comment, add_to_json, made, origin, sources, versions
from millfrf.core.steps import File, Reads, Typed, check_output, step
from millfrf.core.terminal import note, say_written, tell, warn
from millfrf.gate import check_frf, rate_warnings
from modal_fit import ModalModel, import_modes_uff, read_modal_model, write_modal_model, write_modes_uff

UFF_SUFFIXES = (".uff", ".unv")


@step
def convert(
    *files: Annotated[File, Reads("IN... OUT")],
    map: Annotated[File | None, Reads("MAP.toml")] = None,
    span: Annotated[tuple[float, float], Typed("FIRST LAST")] | None = None,
) -> tuple[Path, ...]:
    """Convert files of other programs into recordings, FRFs, modal models and geometries, and back, by their suffixes.

    Recordings .h5 .npz .npy .mat .tdms .mf4 .csv .lvm .xlsx .wav .uff into .h5 .npz .mat .csv; FRFs .uff .unv .mat .npz
    .csv .txt .gz (several files make one matrix) into .h5 .uff; modal models .json into .uff and back; geometries .uff
    .unv .csv into .toml; CAN logs .blf .asc into the events of a recording.

    Parameters
    ----------
    files
        Files to read, and last the file to write; of a single file, its ``.h5`` is written.
    map
        TOML file that says which array or column is which channel or FRF.
    span : s
        First and last time of the part of a recording to keep; without it all.

    Returns
    -------
    tuple of Path
        Files that were written.

    Raises
    ------
    InputError
        Files that cannot be read or written.

    Examples
    --------
    ::

        $ millfrf convert cut1.mat rec1.h5 --map channels.toml
    """
    if not files or (len(files) == 1 and Path(files[0]).suffix.lower() in (".h5", ".hdf5")):
        given = files[0] if files else "no file"
        raise InputError(f"{given} alone: give files to read and a file to write: millfrf convert IN... OUT")
    *sources_, target = (Path(file) for file in (*files, *([_beside(Path(files[0]))] if len(files) == 1 else [])))
    mapping = None if map is None else Path(map)
    if not any(path.exists() and target.exists() and target.samefile(path) for path in sources_):
        refuse_replacing(target)
    if sources_[0].suffix.lower() in CAN_LOGS and not is_frf_conversion(sources_, mapping):
        return (_add_can_log(sources_[0], target, mapping),)
    if is_frf_conversion(sources_, mapping):
        check_output(target, FRF_SUFFIXES, sources_)
    elif mapping is None and is_uff_conversion(sources_[0], target):
        check_output(target, (*FRF_SUFFIXES, ".json", ".toml"), sources_)
    with progress(f"converting {sources_[0].name}") as update:
        written, remarks = convert_files(sources_, target, mapping, update, span)
    tell(lambda: {"inferred": remarks.inferred})
    for text in remarks.inferred:
        note(f"note: {text}")
    warn(remarks.warnings)
    for path in written:
        say_written([path])
    return tuple(written)


def _beside(source: Path) -> Path:
    """Return the path of the file that a single input becomes: ``cut.h5`` of ``cut.csv`` or ``cut.csv.gz``."""
    return source.with_suffix("").with_suffix(".h5") if source.suffix == ".gz" else source.with_suffix(".h5")


def _add_can_log(source: Path, target: Path, mapping: Path | None) -> Path:
    """Add a CAN log to the events of a recording."""
    if mapping is None:
        raise InputError(f"{source} needs --map MAP.toml with recording, dbc and signals")
    with progress(f"adding {source.name}") as update:
        path = add_can_log(source, target, mapping, update, made("convert", [source, mapping]))
    say_written([path])
    return Path(path)


@dataclass(frozen=True)
class Remarks:
    """Remarks of a conversion: values that were inferred, and warnings, which are stored with the result."""

    inferred: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def is_uff_conversion(source: File, target: File) -> bool:
    """Whether one file is UFF, but not of time records alone, or a geometry is written."""
    suffixes = [Path(path).suffix.lower() for path in (source, target)]
    if suffixes[0] in UFF_SUFFIXES and suffixes[1] in RECORDING_SUFFIXES and uff_function_types(Path(source)) == {1}:
        return False
    return suffixes[1] == ".toml" or any(suffix in UFF_SUFFIXES for suffix in suffixes)


def convert_uff(source: File, target: File) -> Remarks:
    """Convert a geometry if the target is ``.toml``, a modal model if either file is ``.json``, else an FRF."""
    suffixes = [Path(path).suffix.lower() for path in (source, target)]
    if suffixes[1] == ".toml":
        return convert_geometry(source, target)
    if ".json" in suffixes:
        return _convert_modes(source, target)
    imported = import_frf([source]) if suffixes[0] in UFF_SUFFIXES else ImportedFrf(read_frf(source))
    return write_imported(target, imported, [source])


def _convert_modes(source: File, target: File) -> Remarks:
    if Path(target).suffix.lower() in UFF_SUFFIXES:
        model = read_modal_model(source)
        write_modes_uff(target, model)
        return Remarks((), _lost_in_uff(model, Path(source).name))
    model, doubts = import_modes_uff(Path(source))
    with writing_whole_file(target) as temporary:
        write_modal_model(temporary, model)
        add_to_json(temporary, made_of([source], Remarks((), doubts)))
    return Remarks((), doubts)


def convert_geometry(source: File, target: File) -> Remarks:
    """Write nodes, local axes and lines of a UFF, CSV or TOML file as TOML."""
    geometry, doubts = import_geometry(source)
    with writing_whole_file(target) as temporary:
        write_geometry(temporary, geometry)
        add_comment(temporary, origin("convert", [source]))
    return Remarks((), doubts)


def write_imported(target: File, imported: ImportedFrf, files: Sequence[File]) -> Remarks:
    """Check an FRF from another program, and write it as .h5 or UFF with its sources and warnings."""
    name = Path(files[0]).name if len(files) == 1 else f"{len(files)} files"
    remarks = Remarks(imported.inferred, (*imported.doubts, *check_frf(imported.frf, name)))
    if Path(target).suffix.lower() in UFF_SUFFIXES:
        write_frf_uff(target, imported.frf)
    else:
        write_frf(target, imported.frf, title=f"from {name}", provenance=json.dumps(made_of(files, remarks)))
    return remarks


def made_of(files: Sequence[File], remarks: Remarks) -> dict[str, Any]:
    """Provenance of something that was converted."""
    texts = {"inferred": list(remarks.inferred), "warnings": list(remarks.warnings)}
    return {"step": "convert", "sources": sources(files), **texts, "versions": versions()}


def _lost_in_uff(model: ModalModel, name: str) -> tuple[str, ...]:
    """Return a warning on the parts of a model that a UFF file of modes cannot contain."""
    lost = [
        what
        for what, present in (
            ("residuals", model.residuals is not None),
            ("error bars", model.covariance is not None),
            ("the delay", bool(model.delay)),
            ("terms of a diagnosis", bool(model.physics)),
        )
        if present
    ]
    return (f"{name}: UFF has no place for {', '.join(lost)}",) if lost else ()


FRF_SUFFIXES = (".h5", ".hdf5", *UFF_SUFFIXES)
RECORDING_SUFFIXES = (".h5", ".npz", ".mat", ".csv")


def convert_files(
    sources: Sequence[Path],
    target: Path,
    mapping: Path | None,
    progress: Callable[[int], None] | None = None,
    span: tuple[float, float] | None = None,
) -> tuple[list[Path], Remarks]:
    """Convert one file, or several that make one FRF matrix; the files written and remarks.

    ``mapping`` is a TOML file with ``channels`` (a recording) or ``[frf]`` (FRFs); ``span`` the first and last time of
    a recording to keep, s from its first sample; ``progress`` is called with the number of samples written.
    """
    if span is not None and (is_frf_conversion(sources, mapping) or is_uff_conversion(sources[0], target)):
        raise InputError("--span cuts a part out of a recording; leave it out for other files")
    if is_frf_conversion(sources, mapping):
        imported = import_frf(sources, None if mapping is None else load_frf_mapping(mapping))
        return [target], write_imported(target, imported, sources)
    if len(sources) > 1:
        raise InputError(
            f"{len(sources)} files to read: only FRFs are merged; convert the others one by one, or give a mapping "
            "with [frf] and [[entries]]"
        )
    if mapping is None and is_uff_conversion(sources[0], target):
        return [target], convert_uff(sources[0], target)
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    origin = made("convert", [sources[0], *([] if mapping is None else [mapping])], {"span_s": span, "at": now})
    said: list[str] = []
    with notices_to(said.append):
        written = convert_recording(sources[0], target, mapping, progress, span=span, provenance=origin)
    warnings = (warning for path in written for warning in (*rate_warnings(path), *_without_place(path)))
    return written, Remarks(tuple(said), tuple(warnings))


def _without_place(path: Path) -> list[str]:
    """Warn of forces and motions whose point and direction are not stated: no FRF has them."""
    if path.suffix.lower() not in (".h5", ".hdf5"):
        return []
    with Recording(path) as recording:
        channels = [channel for stream in recording.streams.values() for channel in stream.channels]
        names = [channel.name for channel in channels if channel.quantity in PLACED and not channel.node]
    if not names:
        return []
    what = f"{path.name}: node and direction of {listed(names)} are not stated, so that no FRF has them"
    return [f"{what}: fill them in in the mapping, and convert again"]


def is_frf_conversion(sources: Sequence[Path], mapping: Path | None) -> bool:
    """Whether FRFs of other programs are read, by the mapping if there is one, else by the content of the files."""
    if mapping is not None:
        return _is_about_frfs(mapping)
    if len(sources) > 1:
        return all(path.suffix.lower() in UFF_SUFFIXES for path in sources) or any(map(looks_like_frf, sources))
    return looks_like_frf(sources[0])


def _is_about_frfs(mapping: Path) -> bool:
    try:
        return is_frf_mapping(tomllib.loads(mapping.read_text(encoding="utf-8")))
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError):  # the reader of mappings reports the mistake
        return False
