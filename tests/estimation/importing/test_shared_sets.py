"""Measured FRFs of other laboratories, from their files: equal to what plain numpy reads in them."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from estimation import FrfMapping, Geometry, import_frf, read_geometry

pytestmark = pytest.mark.shared_data


def test_the_beam_of_nine_text_files(shared_data: Path) -> None:
    folder = shared_data / "modelab-beam"
    files = sorted(folder.glob("*.txt.gz"))
    entries = [
        {"file": path.name, "response": "Accel:-X", "excitation": f"Hammer{k}:+X"} for k, path in enumerate(files, 1)
    ]
    result = import_frf(files, FrfMapping.model_validate({"entries": entries}))
    assert result.frf.quantity == "accelerance"
    assert result.frf.excitations == tuple(f"Hammer{k}:+X" for k in range(1, 10))
    for k, path in enumerate(files):
        with gzip.open(path, "rt", encoding="latin-1") as file:
            f, real, imaginary = np.loadtxt(file, skiprows=9).T
        np.testing.assert_array_equal(result.frf.frequencies, f)
        np.testing.assert_array_equal(result.frf.values[:, 0, k], real + 1j * imaginary)
    geometry: Geometry = read_geometry(folder / "setup.csv")
    assert {label.partition(":")[0] for label in (*result.frf.responses, *result.frf.excitations)} <= set(
        geometry.nodes
    )
    np.testing.assert_allclose(geometry.position("Hammer9"), [0, 0, 1.2])
    np.testing.assert_allclose(geometry.direction("Accel:-X"), [-1, 0, 0])


def test_the_plane_of_seventy_four_points(shared_data: Path) -> None:
    path = shared_data / "plane-hammer" / "plane.npz"
    table = {
        "unit": "m/s^2/N",
        "coherence": "coherence",
        "responses": ["A1:+Z", "A2:+Z", "A3:+Z"],
        "excitations": ["1..68:+Z", "69..74:+X"],
    }
    result = import_frf([path], FrfMapping.model_validate({"frf": table})).frf
    with np.load(path) as stored:
        np.testing.assert_array_equal(result.frequencies, stored["frequency_hz"])
        np.testing.assert_array_equal(
            result.values[result.valid], stored["accelerance"].transpose(2, 1, 0)[result.valid]
        )
        np.testing.assert_array_equal(result.coherence, stored["coherence"].transpose(2, 1, 0))
    assert result.values.shape == (1601, 3, 74)
    assert result.valid[1:].all()
    assert result.excitations[67:69] == ("68:+Z", "69:+X")
