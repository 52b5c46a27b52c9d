"""The large FRF figure: readable limits, peaks that are not cut, pages of few bytes."""

from dataclasses import replace

import numpy as np

from estimation import Frf, to_receptance
from millfrf.figures import FrfCurves, as_data_uri, frf_figures
from modal_fit import ModalModel

BAND = (50.0, 900.0)


def beam() -> tuple[Frf, ModalModel]:
    """Accelerances from near 0 Hz on, with noise, of a structure of very little damping; 0.02 Hz apart."""
    omega = 2 * np.pi * np.array([112.0, 596.4])
    poles = omega * (-1e-4 + 1j)
    shapes = np.array([[1.0, 0.4], [-0.6, 1.0]]) + 0j
    dofs = ("1:+Z", "2:+Z")
    model = ModalModel(poles, shapes, shapes / (2j * poles.imag[:, None]), dofs, dofs, band=BAND)
    axis = np.arange(1, 50_001) * 0.02
    values = model.receptance(axis) * (2j * np.pi * axis[:, None, None]) ** 2
    noise = np.random.default_rng(1).standard_normal((2, *values.shape))
    frf = Frf(axis, values + 0.01 * (noise[0] + 1j * noise[1]), dofs, dofs, "accelerance", "m/s^2/N", axis > 0)
    return frf, model


def test_noise_near_zero_hertz_does_not_push_the_curves_out_of_sight() -> None:
    frf, model = beam()
    [figure] = frf_figures(FrfCurves(to_receptance(frf), (0.02, 1000.0), model, fit_band=BAND))
    low, high = figure.axes[0].get_ylim()
    peak = np.abs(model.receptance(np.array([112.0])))[0, 0, 0]
    assert low < 1e-3 * peak
    assert peak < high < 100 * peak


def test_the_peak_of_the_model_is_drawn_whole() -> None:
    frf, model = beam()
    [figure] = frf_figures(FrfCurves(to_receptance(frf), BAND, model, fit_band=BAND))
    [fitted] = [line for line in figure.axes[0].get_lines() if line.get_label() == "Fitted model"]
    peak = np.abs(model.receptance(model.natural_frequencies))[:, 0, 0].max()
    assert fitted.get_ydata().max() > 0.99 * peak


def test_the_model_is_drawn_under_the_window_of_the_measurement() -> None:
    frf, model = beam()
    tau = 0.05
    values = model.at(2j * np.pi * frf.frequencies + 1 / tau)
    windowed = replace(frf, values=values, quantity="receptance", unit="m/N", exponential_time_constant=tau)
    [figure] = frf_figures(FrfCurves(windowed, BAND, model, fit_band=BAND))
    measured, fitted = (
        next(line for line in figure.axes[0].get_lines() if line.get_label() == label)
        for label in ("Measured", "Fitted model")
    )
    assert fitted.get_ydata().max() < 1.01 * measured.get_ydata().max()


def test_models_are_drawn_where_they_hold() -> None:
    """Before: a reference of 50 to 900 Hz was drawn from 0.02 to 1000 Hz, where it has no say."""
    frf, model = beam()
    known = replace(model, band=(100.0, 700.0))
    [figure] = frf_figures(FrfCurves(to_receptance(frf), (0.02, 1000.0), model, known))
    for label, band in (("Fitted model", BAND), ("Reference model", (100.0, 700.0))):
        [line] = [line for line in figure.axes[0].get_lines() if line.get_label() == label]
        assert (line.get_xdata()[0], line.get_xdata()[-1]) == band


def test_many_lines_make_a_page_of_few_bytes() -> None:
    frf, model = beam()
    [figure] = frf_figures(FrfCurves(to_receptance(frf), BAND, model, fit_band=BAND))
    address = as_data_uri(figure)  # 42 500 lines x 4 entries; as outlines the dots alone are 19 MB
    assert address.startswith("data:image/webp;base64,")
    assert len(address) < 4e5


def test_entries_that_were_not_measured_say_so() -> None:
    frf, _ = beam()
    known = np.eye(2, dtype=bool)
    tapped = replace(to_receptance(frf), values=np.where(known, to_receptance(frf).values, 0.0), measured=known)
    [figure] = frf_figures(FrfCurves(tapped, BAND))
    said = {axes.get_title(): [text.get_text() for text in axes.texts] for axes in figure.axes if axes.get_title()}
    assert said["1:+Z / 1:+Z"] == said["2:+Z / 2:+Z"] == []
    assert said["2:+Z / 1:+Z"] == said["1:+Z / 2:+Z"] == ["not measured"]
