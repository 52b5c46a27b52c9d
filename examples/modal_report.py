"""A modal test of a known structure, and the pictures that a report draws of it.

Run it: `python examples/modal_report.py [FOLDER]`. Twelve points along a beam are measured, two are excited; among five
modes two lie 0.4 Hz apart with other shapes, and one has a complex shape, as a local damper gives it.
"""

import sys
from pathlib import Path

import numpy as np

from estimation import Frf, reciprocity_pairs
from millfrf.figures import (
    GalleryEntry,
    assurance_figure,
    compass_figure,
    gallery_page,
    indicator_figure,
    reciprocity_figure,
    save_figure,
)
from modal_fit import (
    ModalModel,
    complex_mode_indicator,
    fit_polyreference,
    mode_shapes,
    multivariate_mode_indicator,
    synthesis,
)
from replay_data import table_one_model

BAND = (10.0, 120.0)
FREQUENCIES = (22.0, 48.0, 48.4, 71.0, 104.0)
DAMPING = (0.008, 0.006, 0.007, 0.02, 0.01)
NOISE = 0.02
"""Of each entry, relative to its root mean square."""


def structure() -> ModalModel:
    """Five modes of a beam along X: bending in Z, one torsion near the second bending, one complex mode."""
    x = np.linspace(0, 1, 12)
    bending = [np.sin((k + 1) * np.pi * (0.04 + 0.92 * x)) for k in range(4)]
    torsion = np.where(np.arange(12) % 2, 1.0, -1.0) * (0.3 + 0.7 * x)
    shapes = np.array([bending[0], bending[1], torsion, bending[2], bending[3]], dtype=complex)
    shapes[3] *= np.exp(1j * np.radians(50) * x)
    omega, zeta = 2 * np.pi * np.array(FREQUENCIES), np.array(DAMPING)
    poles = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
    points = tuple(f"{k + 1}:+Z" for k in range(12))
    driven = [1, 10]
    left = shapes[:, driven] / (2j * poles.imag[:, None])
    return ModalModel(poles, shapes, left, points, tuple(points[k] for k in driven))


def measured(seed: int = 0) -> Frf:
    """Its accelerance with noise, every 0.1 Hz."""
    axis = np.arange(5.0, 130.0, 0.1)
    truth = structure()
    values = truth.receptance(axis) * (2j * np.pi * axis[:, None, None]) ** 2
    noise = np.random.default_rng(seed).standard_normal((2, *values.shape)) / np.sqrt(2)
    values = values + NOISE * np.sqrt(np.mean(np.abs(values) ** 2, axis=0)) * (noise[0] + 1j * noise[1])
    return Frf(axis, values, truth.responses, truth.excitations, "accelerance", "m/s^2/N", axis > 0)


def main(folder: Path) -> None:
    """Fit, and save the pictures."""
    frf = measured()
    model = fit_polyreference(frf, BAND).model
    indicator = complex_mode_indicator(frf, BAND)
    picture = indicator_figure(indicator, multivariate_mode_indicator(frf, BAND), model)
    save_figure(picture, folder / "mode_indicators.png")
    shapes = mode_shapes(model)
    save_figure(assurance_figure(model, shapes), folder / "auto_mac.png")
    save_figure(compass_figure(model, shapes), folder / "mode_vectors.png")
    robot = table_one_model().frf(np.arange(12.0, 26.0, 0.05))
    save_figure(reciprocity_figure(reciprocity_pairs(robot), robot.unit), folder / "reciprocity.png")
    compared = synthesis(frf, model, BAND)
    entries = [
        GalleryEntry(
            f"{frf.responses[p]} / {frf.excitations[q]}",
            f"{100 * compared.misfit[p, q]:.2g} %",
            compared.measured[:, p, q],
            compared.synthesised[:, p, q],
        )
        for p, q in compared.ranked()[:8]
    ]
    (folder / "frf_gallery.svg").write_text(gallery_page(entries, compared.frequencies).svg(), encoding="utf-8")
    print("modes fitted:", ", ".join(f"{f:.2f} Hz" for f in model.natural_frequencies))
    peaks = [f"{peak.frequency:.1f} Hz (curve {peak.curve})" for peak in indicator.peaks()]
    print("peaks of the CMIF:", ", ".join(peaks))
    print("MPC:", ", ".join(f"{value:.3f}" for value in shapes.collinearity))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
