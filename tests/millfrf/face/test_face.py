"""`import millfrf as mf`: light, every name there, files and objects alike, doubts as warnings, refusals as errors."""

import subprocess
import sys
import warnings
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

import millfrf as mf
from estimation import write_frf
from millfrf.command_line import run
from modal_fit import write_modal_model

CUT = mf.MillingProcess(
    teeth=2,
    diameter=12.7e-3,
    edge_angle=pi / 2,
    ktc=119e6,
    krc=0.17,
    kac=0.33,
    start_angle=pi / 2,
    exit_angle=pi,
    feed_per_tooth=0.15e-3,
)
CUT_FILE = """[cutting]
teeth = 2
diameter_m = 0.0127
edge_angle_deg = 90.0
ktc_pa = 119e6
krc = 0.17
kac = 0.33
start_angle_deg = 90.0
exit_angle_deg = 180.0
feed_per_tooth_m = 0.15e-3
"""
SPEEDS = (1500.0, 3000.0, 5)


def _model() -> mf.ModalModel:
    poles = np.array([-12.0 + 300.0j, -15.0 + 420.0j, -20.0 + 600.0j])
    vectors = np.diag([1e-2, 1e-2, 1e-2]).astype(complex)
    axes = ("TCP:+X", "TCP:+Y", "TCP:+Z")
    return mf.ModalModel(poles, vectors, -1j * vectors, axes, axes, band=(20.0, 400.0))


def test_the_import_loads_none_of_the_libraries_that_compute() -> None:
    heavy = ("numpy", "scipy", "matplotlib", "h5py", "numba", "typer", "pydantic", "estimation", "mismatch")
    code = f"import sys, millfrf; print([name for name in {heavy!r} if name in sys.modules])"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert ended.stdout.strip() == "[]"


def test_every_name_is_there_and_says_what_it_is() -> None:
    assert {"open", "estimate", "fit", "calibrate", "lobes", "diagnose", "predict", "tap", "__version__"} <= set(
        dir(mf)
    )
    for name in dir(mf):
        assert getattr(mf, name).__doc__ or name == "__version__", name
    assert mf.__version__.count(".") >= 2


def test_lobes_of_an_object_and_of_files_are_those_of_the_command(tmp_path: Path) -> None:
    model = _model()
    write_modal_model(tmp_path / "m.json", model)
    (tmp_path / "cut.toml").write_text(CUT_FILE)
    asked = {"speeds": SPEEDS, "max_depth": 5e-3, "method": "zero-order"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.MillfrfWarning)
        of_objects = mf.lobes(model, CUT, **asked)
        of_files = mf.lobes(tmp_path / "m.json", str(tmp_path / "cut.toml"), **asked)
    np.testing.assert_array_equal(of_objects.depth_limits, of_files.depth_limits)
    out = tmp_path / "lobes.csv"
    typed = [str(tmp_path / "m.json"), "--cutting", str(tmp_path / "cut.toml"), "--method", "zero-order"]
    assert run(["lobes", *typed, "--speeds", "1500", "3000", "5", "--max-depth", "0.005", "--out", str(out)]) == 0
    again = mf.open(out)
    assert isinstance(again, mf.StabilityLobes)
    np.testing.assert_allclose(again.depth_limits, of_files.depth_limits, rtol=1e-6)


def test_lobes_choose_speeds_and_depth_by_the_modes_and_the_cutter() -> None:
    model = _model()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.MillfrfWarning)
        result = mf.lobes(model, CUT, method="zero-order")
    f = model.natural_frequencies
    rpm = result.spindle_speeds_rpm
    np.testing.assert_allclose([rpm[0], rpm[-1]], [60 * f.min() / 6, 1.2 * 60 * f.max() / 2])
    assert np.isfinite(result.depth_limits).any()
    assert result.depth_limits[np.isfinite(result.depth_limits)].max() <= CUT.diameter


def test_a_fit_takes_the_band_of_its_frf_and_opens_from_a_file(tmp_path: Path) -> None:
    model = _model()
    rng = np.random.default_rng(1)
    frf = model.frf(np.linspace(20.0, 130.0, 441))
    noise = rng.normal(size=(2, *frf.values.shape)) * 1e-4 * np.abs(frf.values).max()
    frf = replace(frf, values=frf.values + noise[0] + 1j * noise[1], band=(25.0, 120.0))
    write_frf(tmp_path / "frf.h5", frf)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.MillfrfWarning)
        fitted = mf.fit(frf, modes=3)
        of_file = mf.fit(tmp_path / "frf.h5", modes=3)
    assert fitted.band == (25.0, 120.0)
    np.testing.assert_allclose(fitted.model.natural_frequencies, model.natural_frequencies, rtol=1e-3)
    assert of_file.model == fitted.model
    assert mf.open(tmp_path / "frf.h5") == frf


def test_a_doubt_is_a_warning_at_the_users_line() -> None:
    with pytest.warns(mf.MillfrfWarning, match="far below the lowest mode") as seen:
        mf.lobes(_model(), CUT, speeds=(50.0, 60.0, 2), max_depth=1e-3, method="zero-order")
    assert seen[0].filename == __file__


def test_refusals_are_one_line_with_the_remedy(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("nothing")
    with pytest.raises(mf.InputError, match=r"notes\.txt is no recording, FRF"):
        mf.open(tmp_path / "notes.txt")
    with pytest.raises(mf.InputError, match="no file"):
        mf.fit("not_there.h5")
    with pytest.raises(mf.InputError, match=r"recordings 3\.0: give the name of a file or a Recording"):
        mf.estimate(3.0)  # type: ignore[arg-type]
    with pytest.raises(mf.InputError, match="dynamics 3: give the name of a file, a ModalModel"):
        mf.lobes(3, CUT)  # type: ignore[arg-type]
    frf = _model().frf(np.linspace(20.0, 130.0, 441))
    without_peak = _model().frf(np.linspace(1.0, 5.0, 41))
    with pytest.raises(mf.InputError, match=r"has no peak: give speeds in rpm, for example --speeds"):
        mf.lobes(without_peak, CUT)
    with pytest.raises(mf.InputError, match="cannot fit 2 files of frf"):
        mf.fit(frf, frf)
