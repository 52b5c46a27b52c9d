"""Bands: kept by the files of FRFs and models, shared by two results, refused where they make no sense."""

import json
from pathlib import Path

import numpy as np
import pytest

from estimation import read_frf, write_frf
from millfrf.core import InputError, checked_band, shared_band
from modal_fit import ModalModel, read_modal_model, write_modal_model

NAMES = ("T:+X",)


def _model(band: tuple[float, float] | None) -> ModalModel:
    return ModalModel(np.array([-2 + 100j]), np.ones((1, 1)) + 0j, np.ones((1, 1)) + 0j, NAMES, NAMES, band=band)


@pytest.mark.parametrize("band", [(24.0, 12.0), (12.0, 12.0), (-1.0, 5.0), (0.0, float("nan"))])
def test_a_band_that_is_none_is_refused_with_its_value(band: tuple[float, float]) -> None:
    with pytest.raises(InputError, match=r"modal model: band .* is not two increasing"):
        checked_band(band, "modal model")


def test_two_bands_apart_are_refused() -> None:
    with pytest.raises(InputError, match="nothing in common"):
        shared_band((1.0, 2.0), (3.0, 4.0))


@pytest.mark.parametrize("band", [None, (12.0, 24.0)])
def test_files_keep_the_band(tmp_path: Path, band: tuple[float, float] | None) -> None:
    write_modal_model(tmp_path / "m.json", _model(band))
    assert read_modal_model(tmp_path / "m.json").band == band
    frf = _model(band).frf(np.linspace(10, 30, 5))
    assert frf.band == band
    write_frf(tmp_path / "f.h5", frf)
    assert read_frf(tmp_path / "f.h5").band == band


def test_an_older_model_has_the_band_of_its_fit(tmp_path: Path) -> None:
    path = tmp_path / "m.json"
    write_modal_model(path, _model(None))
    content = json.loads(path.read_text())
    content["provenance"] = {"step": "fit", "band_hz": [13.0, 25.0]}
    del content["content_sha256"]
    path.write_text(json.dumps(content))
    assert read_modal_model(path).band == (13.0, 25.0)
