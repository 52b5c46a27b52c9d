"""FRFs in MAT files (versions 5 and 7.3), NPZ and NPY: any order of axes, parts, and facts that nobody states."""

from itertools import permutations
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from estimation import Frf, FrfMapping, ImportedFrf, import_frf
from millfrf.core import FileFormatError, InputError
from tests.estimation.importing.conftest import accelerance

AXES = ("frequency", "response", "excitation")
LABELS = {"responses": ["1..6:+Z"], "excitations": ["1:+Z", "2:+Z"], "unit": "m/s^2/N"}


def read(path: Path, entries: Any = (), **frf: Any) -> ImportedFrf:
    return import_frf([path], FrfMapping.model_validate({"frf": {**LABELS, **frf}, "entries": entries}))


def save_mat73(path: Path, **arrays: Any) -> None:
    """As MATLAB's ``save -v7.3`` does: HDF5 behind 512 bytes, axes reversed, complex numbers as pairs."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in arrays.items():
            array = np.atleast_2d(np.asarray(value))
            if np.iscomplexobj(array):
                pairs = np.empty(array.shape, dtype=[("real", "<f8"), ("imag", "<f8")])
                pairs["real"], pairs["imag"] = array.real, array.imag
                array = pairs
            file.create_dataset(name, data=array.T).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as handle:
        handle.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")


def save(path: Path, kind: str, **arrays: Any) -> Path:
    if kind == "npz":
        np.savez(path / "a.npz", **arrays)
        return path / "a.npz"
    if kind == "mat5":
        savemat(path / "a.mat", arrays, do_compression=True)
    else:
        save_mat73(path / "a.mat", **arrays)
    return path / "a.mat"


@pytest.fixture
def truth(plate: Frf) -> Frf:
    return accelerance(plate)


@pytest.mark.parametrize("kind", ["npz", "mat5", "mat73"])
@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_any_order_of_axes_is_found_by_the_lengths(
    tmp_path: Path, truth: Frf, kind: str, order: tuple[int, int, int]
) -> None:
    coherence = np.random.default_rng(0).uniform(0, 1, truth.values.shape)
    arrays = {"H": truth.values.transpose(order), "coh": coherence.transpose(order)}
    result = read(save(tmp_path, kind, f=truth.frequencies, fs=512.0, **arrays), coherence="coh")
    np.testing.assert_array_equal(result.frf.values, truth.values)
    np.testing.assert_array_equal(result.frf.coherence, coherence)
    np.testing.assert_array_equal(result.frf.frequencies, truth.frequencies)
    assert (result.frf.responses, result.frf.excitations) == (truth.responses, truth.excitations)
    assert any("taken frequency = f, values = H" in text for text in result.inferred)
    assert any(f"taken as {', '.join(AXES[k] for k in order)}" in text for text in result.inferred)


@pytest.mark.parametrize("kind", ["npz", "mat5", "mat73"])
def test_real_and_imaginary_magnitude_and_phase_in_g(tmp_path: Path, truth: Frf, kind: str) -> None:
    h = truth.values / 9.80665
    path = save(tmp_path, kind, f=truth.frequencies, re=h.real, im=h.imag, amp=np.abs(h), ph=np.angle(h))
    axes = {"frequency": "f", "unit": "g/N", "axes": list(AXES)}
    for parts in ({"real": "re", "imaginary": "im"}, {"magnitude": "amp", "phase": "ph", "phase_unit": "rad"}):
        result = read(path, **axes, **parts)
        np.testing.assert_allclose(result.frf.values, truth.values, rtol=1e-12)
        assert result.inferred == ()


@pytest.mark.parametrize("kind", ["npz", "mat5", "mat73"])
def test_one_column_of_the_matrix_and_one_entry(tmp_path: Path, truth: Frf, kind: str) -> None:
    path = save(tmp_path, kind, freq=truth.frequencies, FRF=truth.values[:, :, 1])
    result = read(path, excitations=["2:+Z"])
    np.testing.assert_array_equal(result.frf.values, truth.values[:, :, 1:])
    path = save(tmp_path, kind, freq=truth.frequencies, FRF=truth.values[:, 4, 1])
    result = read(path, responses=["5:+Z"], excitations=["2:+Z"])
    np.testing.assert_array_equal(result.frf.values, truth.values[:, 4:5, 1:])


@pytest.mark.parametrize("kind", ["npz", "mat5", "mat73"])
def test_arrays_that_are_entries(tmp_path: Path, truth: Frf, kind: str) -> None:
    arrays = {f"H{p}{q}": truth.values[:, p, q] for p in range(6) for q in range(2)}
    entries = [
        {"response": f"{p + 1}:+Z", "excitation": f"{q + 1}:+Z", "values": f"H{p}{q}"}
        for p in range(6)
        for q in range(2)
    ]
    path = save(tmp_path, kind, freq=truth.frequencies, **arrays)
    result = read(path, entries, frequency="freq")
    np.testing.assert_array_equal(result.frf.values, truth.values)


@pytest.mark.parametrize("kind", ["npz", "mat5", "mat73"])
def test_lists_along_the_responses_and_columns_of_pairs(tmp_path: Path, truth: Frf, kind: str) -> None:
    """As SignalCalc saves: one file a hammer point, each FRF an array of two columns, frequency and value."""
    for q in range(2):
        pairs = {f"H1_{p + 2}": np.column_stack([truth.frequencies, truth.values[:, p, q]]) for p in range(6)}
        pairs |= {f"C1_{p + 2}": np.column_stack([truth.frequencies, np.full(400, 0.1 * p)]) for p in range(6)}
        path = save(tmp_path, kind, **pairs, ChanNum=np.arange(1, 5)[:, None])
        path.rename(tmp_path / f"run{q}{path.suffix}")
    files = sorted(tmp_path.glob("run*"))
    table = {"frequency": "H1_2[1]", "unit": "m/s^2/N", "responses": ["1..6:+Z"]}
    table["values"] = [f"H1_{p + 2}[2]" for p in range(6)]
    table["coherence"] = [f"C1_{p + 2}[2]" for p in range(6)]
    entries = [{"file": path.name, "excitation": f"{q + 1}:+Z", "averages": 3} for q, path in enumerate(files)]
    result = import_frf(files, FrfMapping.model_validate({"frf": table, "entries": entries})).frf
    np.testing.assert_array_equal(result.values, truth.values)
    assert result.coherence is not None
    np.testing.assert_allclose(result.coherence[9, :, 1], 0.1 * np.arange(6))
    swapped = {name: value for name, value in table.items() if name != "responses"} | {"excitations": ["1..6:+Z"]}
    entries = [{"file": files[0].name, "response": "9:+Z"}]
    result = import_frf(files[:1], FrfMapping.model_validate({"frf": swapped, "entries": entries})).frf
    np.testing.assert_array_equal(result.values[:, 0], truth.values[:, :, 0])
    single = table | {"excitations": ["1:+Z"]}
    result = import_frf(files[:1], FrfMapping.model_validate({"frf": single})).frf
    np.testing.assert_array_equal(result.values, truth.values[:, :, :1])


def test_lists_that_do_not_fit_are_refused(tmp_path: Path, truth: Frf) -> None:
    path = save(tmp_path, "npz", f=truth.frequencies, H=truth.values[:, 0], G=truth.values[:, 0])
    lists = {"values": ["H[1]", "H[2]"], "frequency": "f"}
    with pytest.raises(InputError, match=r"several responses and several excitations"):
        read(path, **lists)
    with pytest.raises(InputError, match=r"entries\[1\] has no response: .*there are 6 responses, 2 values"):
        read(path, [{"excitation": "1:+Z"}], **lists)
    with pytest.raises(InputError, match=r"there are 2 responses, 2 values, 3 coherence"):
        read(path, responses=["1:+Z", "2:+Z"], excitations=["1:+Z"], coherence=["f", "f", "f"], **lists)
    with pytest.raises(InputError, match=r"entries\[1\] names neither response nor excitation"):
        read(path, [{"averages": 2}], **lists)
    with pytest.raises(InputError, match=r"values = 'H\[3\]': H is 400 x 2 and has no column 3"):
        read(path, responses=["1:+Z"], excitations=["1:+Z"], values="H[3]", frequency="f")


def test_a_matlab_structure_and_a_plain_npy(tmp_path: Path, truth: Frf) -> None:
    savemat(tmp_path / "a.mat", {"data": {"f": truth.frequencies, "H": truth.values, "by": "lab"}})
    np.testing.assert_array_equal(read(tmp_path / "a.mat").frf.values, truth.values)
    np.save(tmp_path / "H.npy", truth.values)
    result = read(tmp_path / "H.npy", values="H", frequency_step_hz=0.5, frequency_start_hz=0.5)
    np.testing.assert_array_equal(result.frf.values, truth.values)
    np.testing.assert_allclose(result.frf.frequencies, truth.frequencies)


def test_facts_that_nobody_states_are_required(tmp_path: Path, truth: Frf) -> None:
    path = save(tmp_path, "npz", f=truth.frequencies, H=truth.values, G=truth.values)
    assert "taken frequency = f" in read(path, values="H").inferred[0]
    path = save(tmp_path, "npz", f=truth.frequencies, H=truth.values, G=truth.values, other=truth.frequencies + 1)
    with pytest.raises(InputError, match=r"which of its arrays f 400, H 400 x 6 x 2 complex, .* is the FRF\?"):
        read(path)
    with pytest.raises(InputError, match=r"which of its arrays .* is the frequency\? Write frequency"):
        read(path, values="H")
    with pytest.raises(InputError, match=r"frequency = 'hz' is no array of it"):
        read(path, values="H", frequency="hz")
    with pytest.raises(InputError, match="in no stated unit"):
        read(path, values="H", frequency="f", unit=None)
    with pytest.raises(InputError, match=r'the FRF is 400 x 6 x 2: name its responses under \[frf\] .* \["1..3:\+Z"'):
        read(path, values="H", frequency="f", responses=[])
    with pytest.raises(InputError, match=r"with 5 response, 2 excitation, 400 frequency there is no order"):
        read(path, values="H", frequency="f", responses=["1..5:+Z"])
    with pytest.raises(InputError, match=r"has 3 axes \(400 x 6 x 2\) but axes = \['frequency', 'response'\]"):
        read(path, values="H", frequency="f", axes=["frequency", "response"])
    with pytest.raises(InputError, match=r"400 x 2 x 6 frequencies, responses and excitations, .* names 400 x 6 x 2"):
        read(path, values="H", frequency="f", axes=["frequency", "excitation", "response"])
    with pytest.raises(InputError, match=r"coherence is 400, the FRF 400 x 6 x 2"):
        read(path, values="H", frequency="f", coherence="other")
    with pytest.raises(InputError, match=r"has the shape 400 x 6 x 2; name a column of it"):
        read(path, [{"response": "1:+Z", "excitation": "1:+Z", "values": "H"}], frequency="f")
    square = save(tmp_path, "npz", f=truth.frequencies, H=truth.values[:, :2])
    with pytest.raises(InputError, match="there is more than one order of its axes: write axes"):
        read(square, responses=["1:+Z", "2:+Z"])


@pytest.mark.parametrize("kind", ["npz", "mat5", "mat73"])
def test_damaged_files_end_in_one_line(tmp_path: Path, truth: Frf, kind: str) -> None:
    path = save(tmp_path, kind, f=truth.frequencies, H=truth.values)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 2 // 3])
    with pytest.raises(FileFormatError) as caught:
        read(path)
    assert "\n" not in str(caught.value)
    wrong = truth.values.copy()
    wrong[7, 2, 1] = np.nan
    with pytest.raises(FileFormatError, match=r"3:\+Z / 2:\+Z holds nan at 4 Hz"):
        read(save(tmp_path, kind, f=truth.frequencies, H=wrong))
    with pytest.raises(InputError, match="frequencies do not increase"):
        read(save(tmp_path, kind, f=truth.frequencies[::-1], H=truth.values), frequency="f", values="H")
    with pytest.raises(FileFormatError, match="no array of numbers"):
        read(save(tmp_path, "mat5", note="only words"))


def test_a_mapping_with_a_mistake_is_one_line(tmp_path: Path) -> None:
    from estimation import load_frf_mapping

    for text, message in (
        ("[frf]\nreal = 2\n", "real is given alone; give real and imaginary"),
        ('[frf]\nvalues = "H"\nmagnitude = 1\nphase = 2\n', "values and magnitude are both given"),
        ("[frf]\nreal = 0\nimaginary = 1\n", r"frf\.real must be 1 or more, not 0"),
        ('[frf]\nresponses = ["1:Z"]\n', "degree of freedom 1:Z is not understood"),
        ('[frf]\nresponses = ["5..2:+Z"]\n', "runs from 5 to 2"),
        ('[frf]\nresponses = ["1..3:+Z", "2:+Z"]\n', r"responses hold 2:\+Z twice"),
        ('[frf]\naxes = ["response"]\n', "must name each axis once, 'frequency' among them"),
        ('[frf]\nunits = "g/N"\n', r"frf\.units is not a known key; did you mean unit\?"),
        ('[frf]\nquantity = "inertance"\n', "quantity must be 'receptance'"),
        ('[frf]\naxes = ["frequency"]\n[[entries]]\nresponse = "1:+Z"\nexcitation = "1:+Z"\n', "leave them out where"),
        ("[frf\n", "is not TOML"),
    ):
        (tmp_path / "map.toml").write_text(text)
        with pytest.raises(InputError, match=message) as caught:
            load_frf_mapping(tmp_path / "map.toml")
        assert "\n" not in str(caught.value)
