"""Step ``inspect`` and :func:`open`: the content of any file that the product knows, and its faults."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from acquisition import DEVICES, DeviceSummary, Recording, device_summary
from estimation import Frf, Geometry, read_frf, read_geometry
from millfrf.core import accepting_edited
from millfrf.core.provenance import edits_of, read_provenance
from millfrf.core.steps import File, Reads, step
from millfrf.core.terminal import Table, say, say_concern, show, tell, warn
from millfrf.cutting import approach_angle_of, law_in_words, read_cutting_process
from millfrf.gate import (
    FileKind,
    check_frf,
    check_model,
    check_model_reciprocity,
    check_reciprocity,
    check_signals,
    clock_warnings,
    double_hit_warnings,
    kind_of,
    level_table,
    missing_sample_warnings,
    read_checked_cutting,
    stored_warnings,
    warnings_of,
)
from millfrf.reports.tables import (
    agreement_table,
    error_table,
    mode_table,
    pair_table,
    points_in_words,
    poles_in_words,
    repeats_in_words,
    shape_table,
    source_table,
    tone_table,
    vector_table,
    verdict_table,
)
from millfrf.stability import STATUSES, read_cuts, read_lobes
from modal_fit import read_modal_model, read_picked_poles

from .answers import frf_answer, lobes_answer, model_answer, tables_answer
from .settings import STEPS


def _read_diagnosis(path: File) -> Any:
    from millfrf.mismatch import read_diagnosis  # not above: loading the solvers of a diagnosis takes long

    return read_diagnosis(path)


READERS: Mapping[str, Callable[[File], Any]] = {
    FileKind.RECORDING: Recording,
    FileKind.FRF: read_frf,
    FileKind.MODEL: read_modal_model,
    FileKind.LOBES: read_lobes,
    FileKind.CUTTING: read_cutting_process,
    FileKind.GEOMETRY: read_geometry,
    FileKind.CHATTER: read_cuts,
    FileKind.POLES: read_picked_poles,
    FileKind.DIAGNOSIS: _read_diagnosis,
}


@step
def open(path: Annotated[File, Reads()]) -> Any:
    """Read a file: a recording, an FRF, a modal model, lobes, a diagnosis, a cut, a geometry, verdicts or poles.

    A recording stays open until it is closed; use it in a ``with`` block. Warnings that are stored in a file are
    repeated.

    Parameters
    ----------
    path
        Name of the file; its content decides what it is, not its suffix.

    Returns
    -------
    Recording, Frf, ModalModel, StabilityLobes, Diagnosis, MillingProcess, Geometry, tuple of KeptCut, or array of poles

    Raises
    ------
    InputError
        There is no such file.
    FileFormatError
        The file is of none of these kinds; the message lists them.
    """
    kind = kind_of(path)
    content = READERS[kind](path)
    if kind in (FileKind.FRF, FileKind.MODEL):
        warn(stored_warnings(path), 3)
    return content


@dataclass(frozen=True)
class Findings:
    """Content of a file and its faults."""

    kind: str
    summary: str  # content in one line
    tables: tuple[Table, ...] = ()
    concerns: tuple[str, ...] = ()  # faults, one sentence each with the remedy
    notes: tuple[str, ...] = ()  # further observations, one sentence each


@step
def inspect(file: Annotated[File, Reads()], /) -> "Findings":
    """Show the content of a file and its faults: levels, overload, dead channels, missing samples.

    For periodic forces: their period, the noise between periods, and distortion.

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
        No such file, or a file of another kind.

    Examples
    --------
    ::

        $ millfrf inspect rec1.h5
    """
    with accepting_edited():  # to look at a file is no use of it
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


def inspect_file(path: File) -> Findings:
    """Content and faults of a file of any kind."""
    inspections: dict[str, Callable[[File], Findings]] = {
        FileKind.RECORDING: _recording,
        FileKind.FRF: _frf,
        FileKind.MODEL: _model,
        FileKind.LOBES: _lobes,
        FileKind.CUTTING: _cutting,
        FileKind.GEOMETRY: _geometry,
        FileKind.CHATTER: _chatter,
        FileKind.POLES: _poles,
        FileKind.DIAGNOSIS: _diagnosis,
    }
    return inspections[kind_of(path)](path)


def _recording(path: File) -> Findings:
    tables: list[Table] = []
    concerns: list[str] = []
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
            seen = check_signals(stream)
            tables.append(level_table(stream, seen.levels))
            concerns += [*seen.warnings(stream.sample_rate), *double_hit_warnings(stream, seen.levels)]
            concerns += [*clock_warnings(recording, stream.name), *missing_sample_warnings(recording, stream.name)]
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


def _device_story(recording: Recording) -> DeviceSummary:
    """Describe losses and notices of auxiliary devices in a recording."""
    log = recording.events.get(DEVICES)
    return DeviceSummary() if log is None else device_summary(*log.read(), log.read_texts())


def _text_table(name: str, values: tuple[np.ndarray, np.ndarray], texts: tuple[str, ...]) -> Table:
    """Return a table of marks with their times and notes."""
    rows = tuple((f"{time:.3f}", f"{value:g}", text) for time, value, text in zip(*values, texts, strict=True))
    return Table(name, ("time (s)", "number", "note"), rows)


def _frf(path: File) -> Findings:
    frf = read_frf(path)
    f, concerns = frf.frequencies, warnings_of(check_frf, frf, Path(path).name)
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
        median = np.nan if coherence is None else float(np.median(coherence[_lines_in_band(frf), p]))
        rows.append(
            (response, f"{peak[line]:.3g} {frf.unit}", f"{f[line]:.4g}", "" if np.isnan(median) else f"{median:.3f}")
        )
        if median < 0.5:
            concerns.append(f"{response}: median coherence below 0.5; keep only the band that is excited")
    summary = (
        f"{frf.quantity} in {frf.unit}, {f[0]:g} to {f[-1]:g} Hz in {len(f)} lines, "
        f"excited at {points_in_words(frf.excitations)}"
    )
    concerns += check_reciprocity(frf, Path(path).name)
    concerns += stored_warnings(path)
    pairs = pair_table(frf)
    table = Table("responses", ("response", "largest value", "at (Hz)", "median coherence"), tuple(rows))
    return Findings(FileKind.FRF, summary, (table,) if pairs is None else (table, pairs), tuple(concerns))


def _lines_in_band(frf: Frf) -> NDArray[np.bool_]:
    """Return the valid lines in the band of the FRF; if the FRF has no band, return all valid lines."""
    low, high = frf.band or (0.0, np.inf)
    in_band = frf.valid & (frf.frequencies >= low) & (frf.frequencies <= high)
    return np.asarray(in_band if in_band.any() else frf.valid)


def _model(path: File) -> Findings:
    model = read_modal_model(path)
    concerns = [
        f"mode {r + 1} at {model.natural_frequencies[r]:.4g} Hz has a damping ratio of {zeta:.3g}: not a vibration mode"
        for r, zeta in enumerate(model.damping_ratios)
        if not 0 < zeta < 0.5
    ]
    concerns += warnings_of(check_model, model, Path(path).name)
    concerns += check_model_reciprocity(model, Path(path).name)
    concerns += stored_warnings(path)
    summary = (
        f"modal model, {len(model.poles)} modes, {model.quantity} in {model.unit}, responses "
        f"{points_in_words(model.responses)}, excitations {points_in_words(model.excitations)}"
    )
    by_source = error_table(model)
    candidates = (
        mode_table(model),
        source_table(model),
        agreement_table(read_provenance(path)),
        by_source,
        shape_table(model),
        vector_table(model),
    )
    tables = [table for table in candidates if table is not None]
    return Findings(FileKind.MODEL, summary, tuple(tables), tuple(concerns))


def _lobes(path: File) -> Findings:
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


def _chatter(path: File) -> Findings:
    cuts = [stored.cut for stored in read_cuts(path)]
    tables = [verdict_table(cuts)]
    if any(cut.verdict.foreign for cut in cuts):
        tables.append(tone_table(cuts))
    concerns = [*_edits(path), *read_provenance(path).get("warnings", [])]
    return Findings(
        FileKind.CHATTER, f"verdicts on {len(cuts)} cuts", tuple(tables), tuple(str(concern) for concern in concerns)
    )


def _cutting(path: File) -> Findings:
    process, warnings = read_checked_cutting(path)
    if process.is_turning:
        summary = (
            f"turning data of {Path(path).name}: workpiece of {1e3 * process.diameter:g} mm, Ktc "
            f"{process.ktc / 1e6:g} MPa{law_in_words(process)}, "
            f"edge at {np.degrees(approach_angle_of(process)):g} deg to the feed"
        )
        return Findings(FileKind.CUTTING, summary, concerns=tuple(warnings))
    immersion = (np.degrees(process.start_angle), np.degrees(process.exit_angle))
    summary = (
        f"cutting data of {Path(path).name}: {process.teeth} teeth, {1e3 * process.diameter:g} mm, "
        f"Ktc {process.ktc / 1e6:g} MPa{law_in_words(process)}, immersion {immersion[0]:g} to {immersion[1]:g} deg"
    )
    return Findings(FileKind.CUTTING, summary, concerns=tuple(warnings))


def _poles(path: File) -> Findings:
    summary, tables = poles_in_words(path)
    return Findings(FileKind.POLES, summary, tables)


def _geometry(path: File) -> Findings:
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
    if size > STEPS.largest_structure:
        concerns.append(f"the nodes span {size:.4g} m: is the file in mm? Give its unit")
    if len(geometry.nodes) > 1 and size == 0:
        concerns.append("all nodes lie at one place; no shape can be drawn on them")
    return concerns


def _diagnosis(path: File) -> Findings:
    diagnosis = _read_diagnosis(path)
    causes = ", ".join(cause.name for cause in diagnosis.physics) or "no cause"
    gain = diagnosis.improvement
    error = f"error on {gain.where} {100 * gain.before:.3g} % nominal, {100 * gain.after:.3g} % improved"
    return Findings(
        FileKind.DIAGNOSIS,
        f"diagnosis of a {diagnosis.compared}: {diagnosis.verdict}, {causes}; {error}",
        (),
        (*_edits(path), *diagnosis.doubts),
    )


def _edits(path: File) -> list[str]:
    return [f"{Path(path).name}: {edits}"] if (edits := edits_of(path)) else []


def _answer(file: Path, findings: Findings) -> dict[str, Any]:
    """Return the JSON answer: kind, summary, notes and tables, and the numbers of FRFs, models and lobes."""
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
