"""Step ``new mapping``: a commented mapping for a file of another program, or for its FRFs."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from acquisition import Question, proposed_mapping
from estimation import ArraySource, TextSource, looks_like_frf, open_source, unit_is_of_frf
from millfrf.core import InputError
from millfrf.core.described_tables import described_tables
from millfrf.core.steps import File, Reads, Writes, step
from millfrf.core.terminal import say, say_written

from .templates import FILL_IN, Row, template, toml_files, write_new


@dataclass(frozen=True)
class NewMapping:
    """Text of a mapping, the number of its channels or FRF files, of places to fill in, and what it leaves out."""

    text: str
    n_channels: int
    n_open: int
    left_out: str = ""


@step
def new_mapping(
    *files: Annotated[File, Reads("FILE")],
    frf: bool = False,
    out: Annotated[File | None, Writes(suffixes=(".toml",), needed=True)] = None,
) -> NewMapping:
    """Write a commented mapping with the columns, units and sample rate of a file, or of FRF files.

    Columns and arrays become channels. Time, sample rate and units are recognised by name. Quantities and places are
    guessed from names and marked as guesses. Missing or contradictory statements become questions. Several files, or
    headings of an FRF, get a mapping of FRFs, one a file.

    Parameters
    ----------
    files
        Recording of another program: .mat .csv .npz ..., or its FRFs, such as one file for X and one for Y.
    frf
        Whether the files hold FRFs; without it as their headings and their number say.
    out
        Mapping to write, for `millfrf convert`.

    Returns
    -------
    NewMapping
        Text of the mapping, number of channels, and number of places to fill in.

    Raises
    ------
    InputError
        The file cannot be read or contains no samples.

    Examples
    --------
    ::

        $ millfrf new mapping cut1.mat --out channels.toml
    """
    if not files:
        raise InputError("no file given; name a recording, or the files of FRFs")
    paths = [Path(file) for file in files]
    if frf or len(paths) > 1 or looks_like_frf(paths[0]):
        return _new_frf_mapping(paths, out)
    file, mapping = files[0], _mapping_for(paths[0])
    if out is not None:
        write_new(Path(out), mapping.text)
    say_written([out], f"{mapping.n_channels} channels; quantities and places are guessed from names, check them")
    if mapping.left_out:
        say(mapping.left_out)
    if mapping.n_open:
        say(f"{mapping.n_open} places are open, each marked FILL IN; millfrf convert names what is missing")
    say(f"then: millfrf convert {file} recording.h5 --map {out}")
    return mapping


def _new_frf_mapping(paths: Sequence[Path], out: File | None) -> NewMapping:
    text = frf_mapping_text(paths)
    mapping = NewMapping(text, len(paths), sum(FILL_IN in line for line in text.splitlines()[4:]))
    if out is not None:
        write_new(Path(out), text)
    say_written([out], f"{mapping.n_channels} files of FRFs; directions are guessed from their names, check them")
    if mapping.n_open:
        say(f"{mapping.n_open} places are open, each marked FILL IN; millfrf convert names what is missing")
    say(f"then: millfrf convert {' '.join(map(str, paths))} frf.h5 --map {out}")
    return mapping


def _mapping_for(path: Path) -> NewMapping:
    """Create the mapping for ``millfrf convert``."""
    kind = next(file for file in toml_files() if file.name == "mapping")
    proposal = proposed_mapping(path)
    lines = [
        f"Mapping of {path.name} for: millfrf convert {path.name} OUT.h5 --map THIS.toml",
        f"Quantities, nodes and directions are guessed from names: check each. Places marked {FILL_IN} are open.",
        *proposal.lines,
    ]
    title = "\n".join(lines)
    text = template(title, described_tables(kind), proposal.rows)
    left_out = "".join(line for line in proposal.lines if line.startswith("Left out"))
    return NewMapping(text, proposal.n_channels, text.count(FILL_IN) - title.count(FILL_IN), left_out)


_AXIS = re.compile(r"(?<![a-z])([xyz])(?![a-z])", re.IGNORECASE)
_UNITS = '"m/N", "um/N", "m/s^2/N", "g/N"'


def frf_mapping_text(paths: Sequence[Path]) -> str:
    """Return the commented mapping of FRF files, one FRF each where they are texts.

    Columns, arrays and units are those that the files name. The direction of a file is guessed from a lone x, y or z in
    its name; response and excitation are then the direct term at the tip.
    """
    uff = [path.name for path in paths if path.suffix.lower() in (".uff", ".unv")]
    if uff:
        raise InputError(f"{uff[0]} is UFF, which states what its FRFs are: millfrf convert {uff[0]} frf.h5")
    sources = [open_source(path) for path in paths]
    table, text = _table(sources[0]), isinstance(sources[0], TextSource)
    rows: dict[str, Sequence[Row]] = {"[frf]": [table]}
    if text or len(paths) > 1:
        rows["[[entries]]"] = [_entry(path, len(paths)) for path in paths]
    else:
        where = Question('degrees of freedom along that axis: ["TCP:+X", "TCP:+Y"]')
        order = Question('order of the axes: ["frequency", "response", "excitation"]', open=False)
        table |= {"responses": where, "excitations": where, "axes": order}
    names = " ".join(path.name for path in paths)
    title = (
        f"Mapping of FRFs for: millfrf convert {names} OUT.h5 --map THIS.toml\n"
        f"Directions are guessed from the files' names: check each. Places marked {FILL_IN} are open.\n"
        "Cross terms that no file gives are marked as not measured.\n"
        f"{paths[0].name} holds {sources[0].contents()}."
    )
    kind = next(file for file in toml_files() if file.name == "frf-mapping")
    return template(title, described_tables(kind), rows)


def _table(source: Any) -> dict[str, Any]:
    """Return the keys of ``[frf]``: the places of the numbers and their unit, or questions."""
    places = {name: place for name, place in source.roles().items() if name != "coherence"}
    values = [name for name in ("values", "real", "magnitude") if name in places]
    if not values and isinstance(source, TextSource) and len(source.table.headings) == 3:
        # three columns without headings: analysers write frequency, real and imaginary part
        places, values = {"frequency": 1, "real": 2, "imaginary": 3}, ["real"]
    keys: dict[str, Any] = dict(places)
    if "frequency" not in places and isinstance(source, ArraySource) and (hint := source.steps()):
        keys["frequency_step_hz"] = Question(f"distance of the lines, since no array lists frequencies; {hint}?")
        keys["frequency_start_hz"] = Question(f"frequency of the first line; {hint}?", "-1")
        keys["frequency"] = Question("an array of frequencies, instead of frequency_step_hz", open=False)
    for name in ("frequency", *(() if values else ("values",))):
        keys.setdefault(name, Question(f"column or array, one of: {source.contents()}"))
    unit = source.unit(places[values[0]]) if values else ""
    keys["unit"] = unit if unit_is_of_frf(unit) else Question(f"of the FRF: {_UNITS} ...")
    if values == ["magnitude"]:
        keys.setdefault("phase_unit", Question('"deg" or "rad", where the heading does not say it', open=False))
    return keys


def _entry(path: Path, n_files: int) -> dict[str, Any]:
    axes = {axis.upper() for axis in _AXIS.findall(path.stem)}
    point: Any = f"TCP:+{axes.pop()}" if len(axes) == 1 else Question("node:direction, such as TCP:+X")
    return {"response": point, "excitation": point} | ({"file": path.name} if n_files > 1 else {})
