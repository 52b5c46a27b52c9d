"""Step ``inspect``: what is in a file, and what looks wrong with it."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from acquisition import DEVICES, DeviceStory, Recording, device_story
from estimation import Frf, Geometry, read_frf, read_geometry
from millfrf.core.provenance import read_provenance
from millfrf.core.steps import File, Reads, step
from millfrf.core.terminal import Table, say, say_concern, show, tell
from millfrf.gate import (
    FileKind,
    check_frf,
    check_model,
    check_model_reciprocity,
    check_reciprocity,
    clock_concerns,
    doubts_of,
    kind_of,
    level_table,
    look,
    missing_concerns,
    read_checked_cutting,
    stored_doubts,
    tap_concerns,
)
from millfrf.reports.tables import (
    error_table,
    mode_table,
    pair_table,
    points_in_words,
    poles_in_words,
    repeats_in_words,
    shape_table,
    tone_table,
    vector_table,
    verdict_table,
)
from millfrf.stability import STATUSES, read_cuts, read_lobes
from modal_fit import read_modal_model

from .answers import frf_answer, lobes_answer, model_answer, tables_answer

LARGEST = 100.0
"""m; a structure of some hundred millimetres spans more where they are taken for metres."""


@dataclass(frozen=True)
class Findings:
    """Findings of a look at a file.

    Parameters
    ----------
    kind, summary
        Kind of the file, and its content in one line.
    tables
        Tables that show its contents.
    concerns
        Doubts about the file, one sentence each with the remedy; empty where there is none.
    notes
        What else was found, one sentence each.
    """

    kind: str
    summary: str
    tables: tuple[Table, ...] = ()
    concerns: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@step
def inspect(file: Annotated[File, Reads()], /) -> "Findings":
    """Say what is in a file, and what looks wrong: levels, overload, dead channels, missing samples.

    Where forces repeat: their period, the noise between periods, and distortion.

    Parameters
    ----------
    file
        Recording, FRF, model, lobes, cutting file or geometry.

    Returns
    -------
    Findings
        Kind, summary, tables, notes and concerns.

    Raises
    ------
    InputError
        No such file, or none of these.

    Examples
    --------
    ::

        $ millfrf inspect rec1.h5
    """
    findings = inspect_file(file)
    tell(lambda: _answer(Path(file), findings))
    say(f"{Path(file).name}: {findings.summary}")
    for table in findings.tables:
        show(table)
    for note in findings.notes:
        say(note)
    for concern in findings.concerns:
        say_concern(concern)
    if not findings.concerns:
        say("nothing looks wrong")
    return findings


def inspect_file(path: str | os.PathLike[str]) -> Findings:
    """Look at a recording, an FRF, a model, lobes, a cutting file or a geometry.

    Raises
    ------
    InputError
        No such file, or none of these.
    """
    kind = kind_of(path)
    if kind == FileKind.RECORDING:
        return _recording(path)
    readers: dict[str, Callable[[str | os.PathLike[str]], Findings]] = {
        FileKind.FRF: _frf,
        FileKind.MODEL: _model,
        FileKind.LOBES: _lobes,
        FileKind.CUTTING: _cutting,
        FileKind.GEOMETRY: _geometry,
        FileKind.CHATTER: _chatter,
        FileKind.POLES: _poles,
        FileKind.DIAGNOSIS: _diagnosis,
    }
    return readers[kind](path)


def _recording(path: str | os.PathLike[str]) -> Findings:
    tables, concerns = [], []
    notes: list[str] = []
    with Recording(path) as recording:
        if recording.being_written:
            concerns.append("the recording is still being written")
        elif recording.complete is not True:
            how = f" ({recording.ending})" if recording.ending else ""
            concerns.append(f"the recording was not closed in order{how}: its end may be missing")
        for stream in recording.streams.values():
            if stream.n_samples == 0:
                concerns.append(f"stream {stream.name} holds no sample")
                continue
            seen = look(stream)
            tables.append(level_table(stream, seen.levels))
            concerns += [*seen.concerns(stream.sample_rate), *tap_concerns(stream, seen.levels)]
            concerns += [*clock_concerns(recording, stream.name), *missing_concerns(recording, stream.name)]
            notes += repeats_in_words(stream)
        title = recording.title or "untitled"
        when = f"recorded at {recording.recorded_at}" if recording.recorded_at else "time of recording not known"
        summary = f"recording, {title}, {when}"
        if recording.events:
            rows = tuple((name, str(len(series.read()[0]))) for name, series in recording.events.items())
            tables.append(Table("events", ("name", "values"), rows))
            tables += [
                _text_table(name, series.read(), series.read_texts())
                for name, series in recording.events.items()
                if series.axis.texts and len(series.read_raw()[0])
            ]
            story = _device_story(recording)
            concerns += story.losses
            notes += story.notices
    return Findings(FileKind.RECORDING, summary, tuple(tables), tuple(concerns), tuple(notes))


def _device_story(recording: Recording) -> DeviceStory:
    """What the recording tells of auxiliary devices."""
    log = recording.events.get(DEVICES)
    return DeviceStory() if log is None else device_story(*log.read(), log.read_texts())


def _text_table(name: str, values: tuple[np.ndarray, np.ndarray], texts: tuple[str, ...]) -> Table:
    """Make the table of marks: the time of each, and its note."""
    rows = tuple((f"{time:.3f}", f"{value:g}", text) for time, value, text in zip(*values, texts, strict=True))
    return Table(name, ("time (s)", "number", "note"), rows)


def _frf(path: str | os.PathLike[str]) -> Findings:
    frf = read_frf(path)
    f, concerns = frf.frequencies, doubts_of(check_frf, frf, Path(path).name)
    if not frf.valid.all():
        concerns.append(
            f"{int((~frf.valid).sum())} of {len(f)} lines have no FRF (no force there, or dependent inputs)"
        )
    coherence = frf.multiple_coherence
    if coherence is None and frf.coherence is not None:
        coherence = frf.coherence.min(axis=2)
    rows = []
    for p, response in enumerate(frf.responses):
        peak = np.abs(frf.values[:, p]).max(axis=1)
        line = int(np.argmax(np.where(frf.valid, peak, 0.0)))
        middle = np.nan if coherence is None else float(np.median(coherence[_inside(frf), p]))
        rows.append(
            (response, f"{peak[line]:.3g} {frf.unit}", f"{f[line]:.4g}", "" if np.isnan(middle) else f"{middle:.3f}")
        )
        if middle < 0.5:
            concerns.append(f"{response}: median coherence below 0.5; keep only the band that is excited")
    summary = (
        f"{frf.quantity} in {frf.unit}, {f[0]:g} to {f[-1]:g} Hz in {len(f)} lines, "
        f"excited at {points_in_words(frf.excitations)}"
    )
    concerns += check_reciprocity(frf, Path(path).name)
    concerns += stored_doubts(path)
    pairs = pair_table(frf)
    table = Table("responses", ("response", "largest value", "at (Hz)", "median coherence"), tuple(rows))
    return Findings(FileKind.FRF, summary, (table,) if pairs is None else (table, pairs), tuple(concerns))


def _inside(frf: Frf) -> NDArray[np.bool_]:
    """Valid lines in the band that the FRF states, all valid ones where it states none."""
    low, high = frf.band or (0.0, np.inf)
    inside = frf.valid & (frf.frequencies >= low) & (frf.frequencies <= high)
    return np.asarray(inside if inside.any() else frf.valid)


def _model(path: str | os.PathLike[str]) -> Findings:
    model = read_modal_model(path)
    concerns = [
        f"mode {r + 1} at {model.natural_frequencies[r]:.4g} Hz has a damping ratio of {zeta:.3g}: not a vibration mode"
        for r, zeta in enumerate(model.damping_ratios)
        if not 0 < zeta < 0.5
    ]
    concerns += doubts_of(check_model, model, Path(path).name)
    concerns += check_model_reciprocity(model, Path(path).name)
    concerns += stored_doubts(path)
    summary = (
        f"modal model, {len(model.poles)} modes, {model.quantity} in {model.unit}, responses "
        f"{points_in_words(model.responses)}, excitations {points_in_words(model.excitations)}"
    )
    by_source = error_table(model)
    tables = [
        table for table in (mode_table(model), by_source, shape_table(model), vector_table(model)) if table is not None
    ]
    return Findings(FileKind.MODEL, summary, tuple(tables), tuple(concerns))


def _lobes(path: str | os.PathLike[str]) -> Findings:
    lobes = read_lobes(path)
    if not len(lobes.spindle_speeds):
        return Findings(FileKind.LOBES, "stability lobes", concerns=("the table holds no spindle speed",))
    rpm, depths = lobes.spindle_speeds_rpm, lobes.depth_limits
    summary = f"stability lobes at {len(rpm)} speeds, {rpm.min():.0f} to {rpm.max():.0f} rpm"
    known = np.isfinite(depths)
    if known.any():
        lowest = int(np.where(known, depths, np.inf).argmin())
        summary += f", lowest limit {1e3 * depths[lowest]:.3g} mm at {rpm[lowest]:.0f} rpm"
    counts = [f"{lobes.status.count(name)} {name}" for name in STATUSES if name in lobes.status]
    summary += f"; {', '.join(counts)}"
    concerns = ("no depth limit at any speed",) if not np.isfinite(depths).any() else ()
    return Findings(FileKind.LOBES, summary, concerns=(*concerns, *lobes.warnings))


def _chatter(path: str | os.PathLike[str]) -> Findings:
    cuts = [one.cut for one in read_cuts(path)]
    tables = [verdict_table(cuts)]
    if any(cut.verdict.foreign for cut in cuts):
        tables.append(tone_table(cuts))
    concerns = read_provenance(path).get("warnings", [])
    return Findings(
        FileKind.CHATTER, f"verdicts on {len(cuts)} cuts", tuple(tables), tuple(str(one) for one in concerns)
    )


def _cutting(path: str | os.PathLike[str]) -> Findings:
    process, doubts = read_checked_cutting(path)
    immersion = (np.degrees(process.start_angle), np.degrees(process.exit_angle))
    summary = (
        f"cutting data of {Path(path).name}: {process.teeth} teeth, {1e3 * process.diameter:g} mm, "
        f"Ktc {process.ktc / 1e6:g} MPa, immersion {immersion[0]:g} to {immersion[1]:g} deg"
    )
    return Findings(FileKind.CUTTING, summary, concerns=tuple(doubts))


def _poles(path: str | os.PathLike[str]) -> Findings:
    summary, tables = poles_in_words(path)
    return Findings(FileKind.POLES, summary, tables)


def _geometry(path: str | os.PathLike[str]) -> Findings:
    geometry = read_geometry(path)
    low, high = geometry.positions.min(axis=0), geometry.positions.max(axis=0)
    spans = ", ".join(f"{axis} {a:g} to {b:g} m" for axis, a, b in zip("XYZ", low, high, strict=True))
    turned = 0 if geometry.axes is None else sum(not np.allclose(axes, np.eye(3)) for axes in geometry.axes)
    summary = f"geometry of {len(geometry.nodes)} nodes, {spans}; {turned} with own axes, {len(geometry.lines)} lines"
    rows = tuple(
        (name, *(f"{value:.4g}" for value in position))
        for name, position in zip(geometry.nodes, geometry.positions, strict=True)
    )
    table = Table("nodes", ("node", "X (m)", "Y (m)", "Z (m)"), rows)
    return Findings(FileKind.GEOMETRY, summary, (table,), tuple(_geometry_concerns(geometry)))


def _geometry_concerns(geometry: Geometry) -> list[str]:
    concerns = []
    size = float(np.ptp(geometry.positions, axis=0).max())
    if size > LARGEST:
        concerns.append(f"the nodes span {size:.4g} m: is the file in mm? Give its unit")
    if len(geometry.nodes) > 1 and size == 0:
        concerns.append("all nodes lie at one place; no shape can be drawn on them")
    return concerns


def _diagnosis(path: str | os.PathLike[str]) -> Findings:
    from millfrf.mismatch import read_diagnosis  # not above: other files are looked at without loading the diagnosis

    found = read_diagnosis(path)
    causes = ", ".join(cause.name for cause in found.physics) or "no cause"
    gain = found.improvement
    error = f"error on {gain.where} {100 * gain.before:.3g} % nominal, {100 * gain.after:.3g} % improved"
    return Findings(
        FileKind.DIAGNOSIS, f"diagnosis of a {found.compared}: {found.verdict}, {causes}; {error}", (), found.doubts
    )


def _answer(file: Path, findings: Findings) -> dict[str, Any]:
    """Kind, one line, notes and tables of a file; the numbers of FRFs, models and lobes.

    Parameters
    ----------
    file
        File that was looked at.
    findings
        What was seen.
    """
    fields: dict[str, Any] = {
        "file": file,
        "kind": findings.kind,
        "summary": findings.summary,
        "notes": findings.notes,
        "tables": tables_answer(findings.tables),
    }
    if findings.kind == FileKind.MODEL:
        fields |= model_answer(read_modal_model(file))
    elif findings.kind == FileKind.FRF:
        fields |= frf_answer(read_frf(file))
    elif findings.kind == FileKind.LOBES:
        fields |= lobes_answer(read_lobes(file))
    return fields
