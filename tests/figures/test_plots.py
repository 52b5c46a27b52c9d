"""Results at a prompt and in a notebook: four lines, a table, equality, plots into axes, tables of other libraries."""

import pickle
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from acquisition import Channel, Recording, RecordingWriter, StreamDescription
from estimation import CrossSpectra, Frf, SpectralSettings
from millfrf.core import InputError, Result
from millfrf.figures.cuts import shade_unstable
from millfrf.stability import StabilityLobes
from modal_fit import ModalModel

SCRIPT = "<script>alert(1)</script>"


@pytest.fixture(autouse=True)
def _no_screen() -> Iterator[None]:
    import matplotlib.pyplot as plt

    with mpl.rc_context({"backend": "agg"}):
        yield
        plt.close("all")


def _model() -> ModalModel:
    poles = np.array([-3.0 + 105.0j, -10.0 + 330.0j])
    right = np.array([[1e-3, 2e-4 + 1e-4j], [5e-4j, 1e-3]])
    return ModalModel(poles, right, right, ("TCP:+X", "TCP:+Y"), ("TCP:+X", "TCP:+Y"), band=(5.0, 80.0))


def _frf() -> Frf:
    frf = _model().frf(np.linspace(5.0, 80.0, 151))
    return replace(frf, multiple_coherence=np.full((151, 2), 0.9))


def _lobes() -> StabilityLobes:
    rpm = np.linspace(600, 2400, 5)
    limits = np.array([1.0, 0.5, np.inf, 2.0, np.nan]) * 1e-3
    kinds = ("hopf", "period-doubling", "none", "hopf", "none")
    status = ("verified", "verified", "verified", "lower-bound", "unresolved")
    chatter = np.array([18.0, 17.5, np.nan, 52.0, np.nan])
    return StabilityLobes(rpm * np.pi / 30, limits, chatter, kinds, "collocation", ("doubt",), status)


def _spectra() -> CrossSpectra:
    f = np.linspace(0.0, 50.0, 26)
    force = Channel("fx", "force", "N", "TCP", "+X")
    motion = Channel("ax", "acceleration", "m/s^2", "TCP", "+X")
    ones = np.ones((26, 1, 1), dtype=complex)
    return CrossSpectra(f, 4 * ones, 2j * ones, ones, (force,), (motion,), 12, 7.5, SpectralSettings(256), 128.0)


RESULTS: dict[str, Any] = {"Frf": _frf, "ModalModel": _model, "StabilityLobes": _lobes, "CrossSpectra": _spectra}


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_tells_what_it_holds_and_survives_a_pickle(name: str) -> None:
    each: Result = RESULTS[name]()
    text = repr(each)
    assert text.startswith(f"{name}: ")
    assert 1 <= len(text.splitlines()) <= 4
    assert max(len(line) for line in text.splitlines()) <= 160
    assert "<table>" in each._repr_html_()
    again = pickle.loads(pickle.dumps(each))
    assert again == each
    assert again is not each
    assert repr(again) == text


def test_equality_sees_every_array() -> None:
    model = _model()
    assert model != replace(model, poles=model.poles * (1 + 1e-12))
    assert model != replace(model, band=(5.0, 81.0))
    lobes = _lobes()
    assert lobes != replace(lobes, depth_limits=lobes.depth_limits[::-1])
    assert model != lobes


def test_reprs_say_modes_limits_and_shape() -> None:
    assert "16.72 Hz 2.86 %" in repr(_model())
    assert "52.55 Hz 3.03 %" in repr(_model())
    assert "lowest limit 0.5 mm at 1050 rpm, period-doubling, verified" in repr(_lobes())
    assert "2 responses x 2 excitations" in repr(_frf())
    assert "12 segments of 2 s, worth 7.5 averages" in repr(_spectra())


def test_names_from_a_file_are_escaped_in_html() -> None:
    model = replace(_model(), responses=(SCRIPT, "TCP:+Y"))
    for each in (model, model.frf(np.array([10.0, 20.0]))):
        assert "<script>" not in each._repr_html_()


def test_plots_take_axes_and_give_them_back() -> None:
    frf, model = _frf(), _model()
    axes = frf.plot(response="TCP:+X", excitation="TCP:+X")
    [measured] = axes.get_lines()
    np.testing.assert_allclose(measured.get_ydata(), np.abs(frf.values[:, 0, 0]))
    assert model.plot(axes, response="TCP:+X", excitation="TCP:+X") is axes
    fitted = axes.get_lines()[-1]
    assert fitted.get_label() == "model"
    at_grid = np.abs(model.receptance(np.asarray(fitted.get_xdata()))[:, 0, 0])
    np.testing.assert_allclose(fitted.get_ydata(), at_grid)
    phase = frf.plot(part="phase", response="TCP:+Y", excitation="TCP:+X", color="red")
    assert phase is not axes
    assert phase.get_ylabel() == "Phase of receptance (deg)"
    assert phase.get_lines()[0].get_color() == "red"


def test_a_model_takes_the_quantity_of_the_axes() -> None:
    """The fit of an accelerance is a receptance: into one pair of axes goes one quantity, whoever is first."""
    model, entry = _model(), {"response": "TCP:+X", "excitation": "TCP:+X"}
    grid = np.linspace(10.0, 30.0, 41)
    receptance = model.frf(grid)
    values = receptance.values * (-((2 * np.pi * grid) ** 2))[:, None, None]
    accelerance = replace(receptance, values=values, quantity="accelerance", unit="m/s^2/N")
    axes = model.plot(accelerance.plot(**entry), frequencies=grid, **entry)
    assert axes.get_ylabel() == "Magnitude of accelerance (m/s²/N)"
    measured, *_, fitted = (line for line in axes.get_lines() if len(line.get_xdata()) == len(grid))
    np.testing.assert_allclose(fitted.get_ydata(), measured.get_ydata(), rtol=1e-9)
    over = accelerance.plot(model.plot(frequencies=grid, **entry), **entry)
    assert over.get_ylabel() == "Magnitude of receptance (m/N)"
    np.testing.assert_allclose(over.get_lines()[-1].get_ydata(), np.abs(receptance.values[:, 0, 0]), rtol=1e-9)
    mobility = model.plot(frequencies=grid, quantity="mobility", **entry)
    assert mobility.get_ylabel() == "Magnitude of mobility (m/s/N)"
    moved = np.abs(receptance.values[:, 0, 0]) * 2 * np.pi * grid
    np.testing.assert_allclose(mobility.get_lines()[-1].get_ydata(), moved, rtol=1e-9)
    with pytest.raises(InputError, match="unknown quantity 'inertance'"):
        model.plot(quantity="inertance")


def _outside(axes: Axes) -> list[Line2D]:
    return [line for line in axes.get_lines() if line.get_gid() == "outside the band"]


def test_a_model_over_a_wider_frf_is_drawn_in_its_band_alone() -> None:
    """A fit of 10 to 30 Hz has no say at 52 Hz: neither its curve nor its mode there is drawn over the measurement."""
    model, entry = replace(_model(), band=(10.0, 30.0)), {"response": "TCP:+X", "excitation": "TCP:+X"}
    axes = model.plot(_frf().plot(**entry), **entry)
    fitted = axes.get_lines()[-1]
    assert (fitted.get_label(), min(fitted.get_xdata()), max(fitted.get_xdata())) == ("model", 10.0, 30.0)
    assert not _outside(axes)
    natural = [line.get_xdata()[0] for line in axes.get_lines() if len(line.get_xdata()) == 2]
    np.testing.assert_allclose(natural, model.natural_frequencies[:1])
    with pytest.raises(InputError, match="the axes show 40 to 80 Hz, the model holds in 10 to 30 Hz"):
        model.plot(_frf().sel(band=(40, 80)).plot(**entry), **entry)


@pytest.mark.parametrize("part", ["magnitude", "phase", "real", "imaginary"])
def test_what_lies_outside_the_band_is_marked(part: str) -> None:
    entry = {"response": "TCP:+X", "excitation": "TCP:+X", "part": part}
    f = np.linspace(5.0, 80.0, 151)
    for axes in (
        replace(_frf(), band=(10.0, 30.0)).plot(mpl.figure.Figure().subplots(), **entry),
        replace(_model(), band=(10.0, 30.0)).plot(frequencies=f, **entry),
    ):
        [outside] = _outside(axes)
        [inside] = [line for line in axes.get_lines() if len(line.get_xdata()) == len(f) and line is not outside]
        shown = np.isfinite(inside.get_ydata())
        np.testing.assert_array_equal(shown, (f >= 10.0) & (f <= 30.0))
        beyond = np.isfinite(outside.get_ydata())
        np.testing.assert_array_equal(beyond[~shown], True)
        assert beyond[shown].sum() == 2  # at the edges, where the curves meet
        assert outside.get_alpha() < 1
        legend = [text.get_text() for text in axes.get_legend().get_texts()]
        assert "outside the band, 10 to 30 Hz" in legend


def test_nothing_is_marked_where_the_band_is_not_known_or_is_all() -> None:
    for frf in (_frf(), replace(_frf(), band=None)):
        assert not _outside(frf.plot())


def test_lobes_are_drawn_in_mm_over_rpm_with_gaps() -> None:
    axes = _lobes().plot(label="mine")
    line = axes.get_lines()[0]
    np.testing.assert_allclose(line.get_ydata(), [1.0, 0.5, np.nan, 2.0, np.nan])
    np.testing.assert_allclose(line.get_xdata(), [600, 1050, 1500, 1950, 2400])
    assert _lobes().plot(axes, label="other") is axes
    shown = axes.get_legend()
    assert {"mine", "other", "unstable"} <= {text.get_text() for text in shown.get_texts()}
    colours = {line.get_color() for line in axes.get_lines() if line.get_gid() == "limits"}
    assert len(colours) == 2


def test_spectra_are_drawn_with_their_unit() -> None:
    axes = _spectra().plot()
    assert axes.get_ylabel() == "Power spectral density (N²/Hz)"
    np.testing.assert_allclose(axes.get_lines()[0].get_ydata(), 4.0)
    assert _spectra().plot(side="responses").get_ylabel() == "Power spectral density ((m/s²)²/Hz)"


def test_what_is_not_there_is_refused_with_what_is() -> None:
    with pytest.raises(InputError, match="no response TCP:\\+Q; there are TCP:\\+X, TCP:\\+Y"):
        _frf().plot(response="TCP:+Q")
    with pytest.raises(InputError, match="unknown part 'angle' of an FRF; use one of magnitude, phase"):
        _model().plot(part="angle")
    with pytest.raises(InputError, match="unknown side"):
        _spectra().plot(side="left")


def test_an_frf_becomes_a_data_set_with_its_axes() -> None:
    frf = _frf()
    made = frf.to_xarray()
    entry = made["receptance"].sel(response="TCP:+Y", excitation="TCP:+X")
    np.testing.assert_array_equal(entry.values, frf.values[:, 1, 0])
    np.testing.assert_array_equal(made["frequency"].values, frf.frequencies)
    assert made["receptance"].attrs["unit"] == "m/N"
    assert "coherence" not in made
    spectra = _spectra().to_xarray()
    assert complex(spectra["cross_spectra"].sel(response="ax", excitation_conj="fx")[3]) == 2j


def test_lobes_at_a_single_speed_are_drawn() -> None:
    """Before: a warning of matplotlib, which asked to doubt the numbers."""
    speed, limit, chatter = np.array([120.0]), np.array([1e-3]), np.array([18.0])
    lobes = StabilityLobes(speed, limit, chatter, ("hopf",), "collocation", (), ("verified",))
    figure = mpl.figure.Figure()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        shade_unstable(figure.subplots(), lobes, 3.0)


def test_modes_and_lobes_become_tables() -> None:
    modes = _model().to_frame()
    assert list(modes.index) == [1, 2]
    np.testing.assert_allclose(modes["natural_frequency_hz"], _model().natural_frequencies)
    table = _lobes().to_frame()
    np.testing.assert_allclose(table["depth_limit_m"], _lobes().depth_limits)
    assert list(table["bifurcation"]) == list(_lobes().bifurcations)


def _recording(folder: Path) -> Path:
    channels = (Channel("fx", "force", "N", "TCP", "+X"), Channel("ax", "acceleration", "m/s^2", "TCP", "+X"))
    path = folder / "cut.h5"
    time = np.arange(2000) / 1000.0
    samples = np.stack([5 + 2 * np.sin(60 * time), np.cos(60 * time)], axis=1)
    with RecordingWriter(path, (StreamDescription("main", 1000.0, 0.0, channels),), title="a <b>cut</b>") as writer:
        writer.append("main", samples)
    return path


def test_a_recording_tells_draws_and_tables_itself(tmp_path: Path) -> None:
    path = _recording(tmp_path)
    with Recording(path) as each, Recording(path) as other:
        assert repr(each).splitlines()[0] == "Recording: cut.h5, 1 stream"
        assert "Stream main: 2 channels, 2 s at 1000 Hz" in repr(each)
        assert "channels fx, ax" in repr(each)
        assert "a <b>cut" not in each._repr_html_()
        assert each == other
        assert hash(each) == hash(other)
        with pickle.loads(pickle.dumps(each)) as again:
            assert again == each
            np.testing.assert_array_equal(again.stream().read(), each.stream().read())
        table = each.to_frame()
        np.testing.assert_array_equal(table["fx"], each.stream().read(channels=["fx"])[:, 0])
        assert table.index[1] == 0.001
        assert each.to_xarray().sel(channel="ax").shape == (2000,)
        axes = each.plot(channels=["fx"])
        assert [label.get_text() for label in axes.get_yticklabels()] == ["fx\n± 2 N"]
    assert repr(each) == "Recording: cut.h5, closed"
