"""Sections on results: inputs, modes, shapes, comparison of models."""

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from estimation import AveragingSettings, Frf, Geometry, spectra_of_tests
from millfrf.core import with_error
from millfrf.core.terminal import Table
from millfrf.figures import (
    assurance_figure,
    compass_figure,
    indicator_figure,
    input_figure,
    mode_figure,
    moving_shapes,
    shapes_figure,
    stabilisation_figure,
    zoomed_chart,
    zoomed_indicators,
)
from modal_fit import (
    ComplexModeIndicator,
    ModalModel,
    ModePair,
    ModeShapes,
    chart_from_json,
    compare_modes,
    complex_mode_indicator,
    multivariate_mode_indicator,
)

from ..collection import Collected, SourceFile
from ..section import Fold, Picture, Section, picture_of
from ..tables import (
    agreement_table,
    error_table,
    mode_table,
    shape_table,
    shapes_of,
    source_table,
)
from .frfs import Band, axis_of, band_of, shown_frf


def comparison_section(collected: Collected) -> Section:
    """Compare each model, mode by mode, with the first model that has the same degrees of freedom."""
    tables, sentences = [], []
    fitted = [pair for pair in collected.models if pair[0].provenance.get("step") == "fit"]
    for number, (file, model) in enumerate(fitted):
        alike = [pair for pair in fitted[:number] if _same_axes(pair[1], model)]
        if not alike:
            continue
        base_file, base = alike[0]
        pairs = compare_modes(base, model)
        tables.append(_table(base_file, base, file, pairs))
        sentences.append(_summary(base_file, base, file, pairs))
    return Section("Models compared", tuple(sentences), tuple(tables))


def _same_axes(first: ModalModel, second: ModalModel) -> bool:
    return (first.responses, first.excitations, first.unit) == (second.responses, second.excitations, second.unit)


def _table(base_file: SourceFile, base: ModalModel, file: SourceFile, pairs: tuple[ModePair, ...]) -> Table:
    rows = []
    for pair in pairs:
        zeta = base.damping_ratios[pair.first]
        rows.append(
            (
                str(pair.first + 1),
                f"{base.natural_frequencies[pair.first]:.3f}",
                with_error(pair.frequency_change, 2 * pair.frequency_error, sign=True),
                f"{100 * zeta:.3f}",
                with_error(100 * pair.damping_change, 200 * pair.damping_error, sign=True),
                f"{pair.right_likeness:.3f} / {pair.left_likeness:.3f}",
                "moved" if pair.moved else "",
            )
        )
    columns = ("mode", "fn (Hz)", "change (Hz)", "zeta (%)", "change (%)", "MAC right / left", "")
    title = f"{base_file.path.name}, and what changed in {file.path.name} (± 2 standard errors)"
    return Table(title, columns, tuple(rows))


def _summary(base_file: SourceFile, base: ModalModel, file: SourceFile, pairs: tuple[ModePair, ...]) -> str:
    moved = [pair for pair in pairs if pair.moved]
    text = f"{file.path.name} against {base_file.path.name}: {len(pairs)} modes in common"
    alone = len(base.poles) - len(pairs)
    text += f", {alone} modes have no counterpart" if alone else ""
    if np.isnan([pair.frequency_error for pair in pairs]).any():
        return text + "; a model has no error bars, so that the significance of changes is not known."
    if not moved:
        return text + "; none moved by more than three standard errors of the change."
    names = ", ".join(f"{base.natural_frequencies[pair.first]:.2f} Hz" for pair in moved[:8])
    more = f" and {len(moved) - 8} more" if len(moved) > 8 else ""
    largest = max(pair.significance for pair in moved)
    return text + (
        f"; moved by more than three standard errors: {names}{more} (at most {largest:.0f} standard errors). "
        "If both come from the same recordings, one method has a bias; if the amplitudes differ, the structure "
        "is not linear."
    )


def has_lines(frf: Frf, band: Band) -> bool:
    """Return whether enough lines lie in the band for a curve."""
    inside = frf.valid & (frf.frequencies > 0) & (frf.frequencies >= band[0]) & (frf.frequencies <= band[1])
    return int(inside.sum()) > 2


def indicator_part(name: str, frf: Frf, model: ModalModel, band: Band) -> tuple[Picture, tuple[str, ...]]:
    """Draw both indicators in the band of a fit, and describe peaks without a mode.

    Parameters
    ----------
    name
        Name of the model's file.
    frf
        FRF to which the model was fitted.
    model
        Modal model whose modes are marked.
    band : Hz
        Lowest and highest frequency of the fit.
    """
    indicator, multivariate = complex_mode_indicator(frf, band), multivariate_mode_indicator(frf, band)
    single = len(multivariate.references) == 1
    caption = (
        f"{name}: mode indicators of the FRF. (a) Complex mode indicator (CMIF), the singular values of the FRF "
        "matrix: a mode is a peak of the first curve; two close modes are peaks of two curves at one frequency. (b) "
        + ("Mode indicator (MIF)" if single else "Multivariate mode indicator (MIF)")
        + ", the share of the motion in phase with the forces: 0 at a single real mode."
    )
    zoomed = zoomed_indicators(indicator, multivariate, model)
    words = f"Mode indicators of {name} over frequency"
    picture = picture_of(indicator_figure(indicator, multivariate, model), caption, words, zoomed=zoomed)
    return picture, _unexplained(name, indicator, model)


def _unexplained(name: str, indicator: ComplexModeIndicator, model: ModalModel) -> tuple[str, ...]:
    """Describe the peaks of the first curve that belong to no mode.

    Their distance from every mode exceeds twice the half-power bandwidth of the mode and two spectral lines.
    """
    step = float(np.median(np.diff(indicator.frequencies)))
    reach = 2 * np.maximum(2 * model.damping_ratios * model.natural_frequencies, step)
    alone = [
        f"{peak.frequency:.2f} Hz"
        for peak in indicator.peaks(2.0)  # peaks of at least twice their valleys
        if peak.curve == 1 and (np.abs(model.natural_frequencies - peak.frequency) > reach).all()
    ]
    if not alone:
        return ()
    single = len(alone) == 1
    return (
        f"{name}: the CMIF has {'a peak' if single else 'peaks'} without a mode at {', '.join(alone)}: a missing "
        "mode, an excitation from the surroundings, or noise.",
    )


FEW = 6  # degrees of freedom up to which right and left vectors are drawn with a name at each component
MAX_MODES = 40  # modes that are drawn
ALIKE = 0.9  # MAC from which two modes are reported as similar


def shape_part(
    name: str, model: ModalModel, geometries: Sequence[tuple[str, Geometry]] = ()
) -> tuple[tuple[Table, ...], tuple[Picture, ...], tuple[str, ...]]:
    """Make tables, pictures and sentences on the mode shapes of a model; nothing if the model has no shapes.

    Parameters
    ----------
    name
        Name of the model's file.
    model
        Modal model with at least two degrees of freedom on one side.
    geometries
        File name and geometry of each; the first one that contains a point of the model is drawn.
    """
    shapes, table = shapes_of(model), shape_table(model, f"{name}: mode shapes")
    if shapes is None or table is None:
        return (), (), ()
    pictures = []
    if 1 < len(model.poles) <= MAX_MODES:
        pictures.append(_assurance(name, model, shapes))
    if max(len(model.responses), len(model.excitations)) <= FEW:
        pictures.append(_right_and_left(name, model))
    elif len(model.poles) <= MAX_MODES:
        pictures.append(_compasses(name, model, shapes))
    moving, missing = _moving(name, model, shapes, geometries)
    return (table,), (*moving, *pictures), (*_alike(name, model, shapes), *missing)


def _moving(
    name: str, model: ModalModel, shapes: ModeShapes, geometries: Sequence[tuple[str, Geometry]]
) -> tuple[tuple[Picture, ...], tuple[str, ...]]:
    """Draw the shapes on the first geometry that has a point of the model, and name the nodes that do not move."""
    for file, geometry in geometries:
        moving = moving_shapes(geometry, model, shapes)
        if moving is None:
            continue
        nodes = list(dict.fromkeys(dof.split(":")[0] for dof in shapes.dofs))
        unknown = [node for node in nodes if node not in geometry.nodes]
        still = len(geometry.nodes) - int(moving.measured.sum())
        notes = [f"{still} of its {len(geometry.nodes)} nodes were not measured and do not move"] if still else []
        notes += [f"{', '.join(unknown[:5])} are not in the geometry and are not drawn"] if unknown else []
        caption = (
            f"{name}: mode shapes ({shapes.side} vectors) on {file}. Grey: at rest; blue: displaced, dots where it was "
            "measured. Only measured directions move."
        )
        words = f"Mode shapes of {name} on the geometry of {file}"
        picture = picture_of(shapes_figure(moving), caption, words, moving=moving)
        return (picture,), tuple(f"{name} on {file}: {note}." for note in notes)
    if not geometries:
        return (), ()
    return (), (f"{name}: no geometry has one of its points; its shapes are not drawn in place.",)


def _assurance(name: str, model: ModalModel, shapes: ModeShapes) -> Picture:
    caption = (
        f"{name}: (a) auto-MAC of the {shapes.side} vectors in %: a dark cell off the diagonal means two modes "
        f"that the {len(shapes.dofs)} points cannot distinguish; (b) modal phase collinearity, 1 for a real mode; "
        "(c) mean phase deviation, 0 for a real mode."
    )
    return picture_of(assurance_figure(model, shapes), caption, "Auto-MAC matrix, MPC and MPD")


def _compasses(name: str, model: ModalModel, shapes: ModeShapes) -> Picture:
    caption = (
        f"{name}: the {len(shapes.dofs)} components of each {shapes.side} vector in the complex plane, turned to their "
        "best straight line; circle: largest component. A real mode has all components on the horizontal "
        "line; check the point of a single component off it."
    )
    return picture_of(compass_figure(model, shapes), caption, "Modal vectors in the complex plane")


def _right_and_left(name: str, model: ModalModel) -> Picture:
    caption = (
        f"{name}: modal vectors in the complex plane, each scaled to its largest component. Right "
        "and left vectors agree where the structure is reciprocal; a real mode has all components on one line."
    )
    return picture_of(mode_figure(model), caption, "Modal vectors")


def _alike(name: str, model: ModalModel, shapes: ModeShapes) -> tuple[str, ...]:
    if len(shapes.dofs) <= FEW:  # few points cannot distinguish most modes, as the table shows
        return ()
    f = model.natural_frequencies
    return tuple(
        f"{name}: modes {i + 1} and {j + 1} at {f[i]:.2f} and {f[j]:.2f} Hz have similar shapes (MAC "
        f"{shapes.assurance[i, j]:.2f}): one mode found twice, or points that cannot distinguish them."
        for i, j in shapes.alike(ALIKE)
    )


def dropped_part(file: SourceFile) -> tuple[Fold, ...]:
    """List the rejected groups of poles of a fit in a folded part; nothing if the model's file contains no groups."""
    stored = file.provenance.get("dropped") if file.provenance.get("step") == "fit" else None
    groups = [_dropped(group) for group in stored] if isinstance(stored, list) else []
    if not groups:
        return ()
    rows = tuple((f"{frequency:.2f}", f"{100 * ratio:.2f}", reason) for frequency, ratio, reason in sorted(groups))
    title = f"{file.path.name}: {len(rows)} groups of poles that were not accepted as modes, and why"
    return (Fold(title, tables=(Table(title, ("frequency (Hz)", "damping ratio (%)", "why"), rows),)),)


def _dropped(group: Any) -> tuple[float, float, str]:
    """Return frequency (Hz), damping ratio and reason of a group; numbers that are none are NaN."""
    values = group if isinstance(group, dict) else {}
    numbers = (values.get(name) for name in ("frequency_hz", "damping_ratio"))
    frequency, ratio = (float(value) if isinstance(value, int | float) else math.nan for value in numbers)
    return frequency, ratio, str(values.get("reason", ""))


def input_section(collected: Collected, band: Band | None) -> Section:
    """Show the independence of the inputs of each FRF whose recordings are among the files."""
    pictures = []
    for file, frf in collected.frfs:
        recordings = collected.recordings_of(file)
        if file.provenance.get("step") != "estimate":
            continue
        if not recordings or len(recordings) != len(file.provenance["sources"]) or len(frf.excitations) < 2:
            continue
        tests = spectra_of_tests([recording.path for recording in recordings], _averaging(file))
        fitted = collected.model_of(file, frf)
        axis = band or axis_of(frf, band_of(fitted[0]) if fitted else None)
        caption = (
            f"{file.path.name}: (a) power spectra of the inputs; (b) singular values of their spectral matrix, all "
            f"{len(tests)} tests stacked{', and the smallest of each test alone' if len(tests) > 1 else ''}; where the "
            "smallest is zero the inputs are dependent; (c) coherence between each two inputs."
        )
        pictures.append(picture_of(input_figure(tests, axis), caption, "Independence of the inputs"))
    return Section("Excitation", pictures=tuple(pictures))


def _averaging(file: SourceFile) -> AveragingSettings:
    """Return the averaging settings of an FRF's estimation, with its channels by name."""
    made = file.provenance
    names = {field.name for field in fields(AveragingSettings)}
    stored = {name: value for name, value in made["options"].items() if name in names}
    stored["band"] = tuple(stored["band"]) if stored["band"] else None
    stored["excitations"] = tuple(made["excitation_channels"])
    stored["responses"] = tuple(made["response_channels"])
    return AveragingSettings(**stored)


def mode_section(collected: Collected) -> Section:
    """Show modes of each model, quality of the fit, stabilisation chart and vectors."""
    tables, pictures, sentences = [], [], []
    folds: list[Fold] = []
    for file, model in collected.models:
        tables.append(mode_table(model, f"{file.path.name}"))
        by_source = error_table(model, f"{file.path.name}: standard errors by source")
        bands = source_table(model, f"{file.path.name}: bands")
        compared = agreement_table(file.provenance, f"{file.path.name}: cut and taps at the sensor")
        tables += [table for table in (bands, compared, by_source) if table is not None]
        sentences += _quality(file)
        if file.provenance.get("step") == "fit":
            pictures.append(_stabilisation(collected, file, model))
            shown, peaks = _indicators(collected, file, model)
            pictures += shown
            sentences += peaks
        shape_tables, shape_pictures, shape_sentences = shape_part(
            file.path.name, model, [(known.path.name, geometry) for known, geometry in collected.geometries]
        )
        tables += shape_tables
        pictures += shape_pictures
        sentences += shape_sentences
        folds += dropped_part(file)
    return Section("Modal model", tuple(sentences), tuple(tables), tuple(pictures), tuple(folds))


def _quality(file: SourceFile) -> list[str]:
    made = file.provenance
    if made.get("step") != "fit":
        return []
    text = (
        f"{file.path.name}: {made['method']} up to order {made['max_order']}, {made['band_hz'][0]:g} to "
        f"{made['band_hz'][1]:g} Hz"
    )
    if made.get("picked_poles") is not None:
        text += f"; {made['status']} ({made['picked_poles']['file']})"
    if made.get("relative_error") is not None:
        error = 100 * np.asarray(made["relative_error"])
        text += f"; misfit between {error.min():.2g} and {error.max():.2g} % of each FRF's rms"
    chi = made.get("reduced_chi_square")
    return [text + ("." if chi is None else f"; misfit over noise (reduced chi-square) {chi:.2f}.")]


def _indicators(
    collected: Collected, file: SourceFile, model: ModalModel
) -> tuple[tuple[Picture, ...], tuple[str, ...]]:
    """Draw mode indicators of the FRF to which a model was fitted, if it is among the files."""
    frf, band = collected.frf_of(file), band_of(file)
    if frf is None or band is None or not has_lines(frf, band):
        return (), ()
    picture, peaks = indicator_part(file.path.name, frf, model, band)
    return (picture,), peaks


def _stabilisation(collected: Collected, file: SourceFile, model: ModalModel) -> Picture:
    frf = collected.frf_of(file)
    shown = None if frf is None else shown_frf(frf, model)
    chart = chart_from_json(file.provenance.get("stabilisation", {}))
    caption = (
        f"{file.path.name}: stabilisation chart; (a) poles over model order above the summed FRF, (b) damping of the "
        "poles that are stable in frequency and damping. Vertical lines and diamonds: modes of the fitted model."
    )
    zoomed = zoomed_chart(chart, shown, model)
    words = f"Stabilisation chart of {file.path.name}: poles over model order and damping"
    return picture_of(stabilisation_figure(chart, shown, model), caption, words, zoomed=zoomed)
