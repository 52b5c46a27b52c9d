"""The sections on the results: inputs and modes."""

from dataclasses import replace

import numpy as np

from millfrf.figures import input_figure, stabilisation_figure, zoomed_chart
from modal_fit import ModalModel

from ...chain import EstimateOptions, chart_from_json, spectra_of_tests
from ...progress import Progress
from ...tables import error_table, mode_table
from ..collection import Collected, SourceFile
from ..section import Fold, Picture, Section, picture_of
from .dropped_part import dropped_part
from .frfs import Band, axis_of, band_of, shown_frf
from .indicator_part import has_lines, indicator_part
from .shape_part import shape_part


def input_section(collected: Collected, band: Band | None, progress: Progress) -> Section:
    """Independence of the inputs of each FRF whose recordings are among the files."""
    pictures = []
    for file, frf in collected.frfs:
        recordings = collected.recordings_of(file)
        if file.provenance.get("step") != "estimate":
            continue
        if not recordings or len(recordings) != len(file.provenance["sources"]) or len(frf.excitations) < 2:
            continue
        tests = spectra_of_tests([recording.path for recording in recordings], _options(file), progress)
        found = collected.model_of(file, frf)
        axis = band or axis_of(frf, band_of(found[0]) if found else None)
        caption = (
            f"{file.path.name}: (a) power spectra of the inputs; (b) singular values of their spectral matrix, all "
            f"{len(tests)} tests stacked{', and the smallest of each test alone' if len(tests) > 1 else ''}; where the "
            "smallest vanishes the inputs are dependent; (c) coherence between each two inputs."
        )
        pictures.append(picture_of(input_figure(tests, axis), caption, "Independence of the inputs"))
    return Section("Excitation", pictures=tuple(pictures))


def _options(file: SourceFile) -> EstimateOptions:
    """The options an FRF was estimated with, its channels by name."""
    made = file.provenance
    stored = dict(made["options"])
    stored["band"] = tuple(stored["band"]) if stored["band"] else None
    options = EstimateOptions(**stored)
    channels = (tuple(made["excitation_channels"]), tuple(made["response_channels"]))
    return replace(options, excitations=channels[0], responses=channels[1])


def mode_section(collected: Collected) -> Section:
    """Modes of each model, quality of the fit, stabilisation, vectors."""
    tables, pictures, sentences = [], [], []
    folds: list[Fold] = []
    for file, model in collected.models:
        tables.append(mode_table(model, f"{file.path.name}"))
        by_source = error_table(model, f"{file.path.name}: standard errors by source")
        tables += [] if by_source is None else [by_source]
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
    """Mode indicators of the FRF that a model was fitted to, where that is among the files."""
    frf, band = collected.frf_of(file), band_of(file)
    if frf is None or band is None or not has_lines(frf, band):
        return (), ()
    picture, peaks = indicator_part(file.path.name, frf, model, band)
    return (picture,), peaks


def _stabilisation(collected: Collected, file: SourceFile, model: ModalModel) -> Picture:
    frf = collected.frf_of(file)
    shown = None if frf is None else shown_frf(frf, model)
    chart = chart_from_json(file.provenance["stabilisation"])
    caption = (
        f"{file.path.name}: stabilisation chart; (a) poles over model order above the summed FRF, (b) damping of the "
        "poles that are stable in frequency and damping. Vertical lines and diamonds: modes of the fitted model."
    )
    zoomed = zoomed_chart(chart, shown, model)
    words = f"Stabilisation chart of {file.path.name}: poles over model order and damping"
    return picture_of(stabilisation_figure(chart, shown, model), caption, words, zoomed=zoomed)
