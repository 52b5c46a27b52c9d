"""FRFs of UFF files that other programs wrote: units, coherences, nodes of components, and files that are damaged."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from estimation import Frf, read_frf_uff, write_frf_uff
from estimation.importing.uff_frfs import UffChoice, import_uffs
from millfrf.core import FileFormatError, InputError
from tests.estimation.importing.conftest import accelerance, coherence_of, function, write_sets

LABELS = {"ordinate_axis_units_lab": "NONE", "orddenom_axis_units_lab": "NONE"}


def sets_of(frf: Frf, **changed: Any) -> list[dict[str, Any]]:
    return [
        function(frf.frequencies, frf.values[:, p, q], response, excitation, **changed)
        for p, response in enumerate(frf.responses)
        for q, excitation in enumerate(frf.excitations)
    ]


def test_a_matrix_with_coherences_in_any_order(tmp_path: Path, plate: Frf) -> None:
    truth = accelerance(plate)
    coherence = np.random.default_rng(0).uniform(0.2, 1.0, truth.values.shape)
    sets = sets_of(truth) + [
        coherence_of(truth.frequencies, coherence[:, p, q], response, excitation)
        for p, response in enumerate(truth.responses)
        for q, excitation in enumerate(truth.excitations)
    ]
    order = [0, *np.random.default_rng(1).permutation(np.arange(1, len(sets)))]
    frf = read_frf_uff(write_sets(tmp_path / "a.unv", *[sets[k] for k in order]))
    assert frf.quantity == "accelerance"
    rows = [frf.responses.index(label) for label in truth.responses]
    columns = [frf.excitations.index(label) for label in truth.excitations]
    np.testing.assert_allclose(frf.frequencies, truth.frequencies, rtol=1e-5)
    np.testing.assert_allclose(frf.values[:, rows][:, :, columns], truth.values, rtol=1e-10)
    assert frf.coherence is not None
    np.testing.assert_allclose(frf.coherence[:, rows][:, :, columns], coherence, rtol=1e-10)


@pytest.mark.parametrize(
    ("kinds", "labels", "factor", "quantity"),
    [
        ((12, 13), ("g", "N"), 9.80665, "accelerance"),
        ((12, 13), ("mm/s^2", "kN"), 1e-6, "accelerance"),
        ((8, 13), ("um", "N"), 1e-6, "receptance"),
        ((11, 13), ("m/s", "NONE"), 1.0, "mobility"),
        ((12, 9), ("(m/s^2)/N", "N"), 1.0, "accelerance"),
        ((1, 0), ("(1/N)*(m/s²)", "NONE"), 1.0, "accelerance"),
    ],
)
def test_units_by_their_labels(
    tmp_path: Path, plate: Frf, kinds: tuple[int, int], labels: tuple[str, str], factor: float, quantity: str
) -> None:
    stated = {"ordinate_spec_data_type": kinds[0], "orddenom_spec_data_type": kinds[1]}
    units = {"ordinate_axis_units_lab": labels[0], "orddenom_axis_units_lab": labels[1]}
    result = read_frf_uff(write_sets(tmp_path / "a.uff", *sets_of(plate, **stated, **units)))
    assert result.quantity == quantity
    np.testing.assert_allclose(result.values, plate.values * factor, rtol=1e-10)


def test_without_labels_the_units_of_the_file_count_and_it_is_said(tmp_path: Path, plate: Frf) -> None:
    truth = accelerance(plate)
    millimetres = {"type": 164, "units_code": 5, "units_description": "mm", "temp_mode": 1}
    factors = {"length": 1e3, "force": 1e3, "temp": 1.0, "temp_offset": 273.15}
    path = write_sets(tmp_path / "a.unv", millimetres | factors, *sets_of(truth, **LABELS))
    imported = import_uffs([path], UffChoice())
    np.testing.assert_allclose(imported.frf.values, truth.values, rtol=1e-10)
    assert "set 164" in imported.inferred[0]
    path = write_sets(tmp_path / "b.unv", millimetres | factors | {"force": 1.0}, *sets_of(truth, **LABELS))
    np.testing.assert_allclose(read_frf_uff(path).values, truth.values / 1e3, rtol=1e-10)
    imported = import_uffs([write_sets(tmp_path / "c.unv", *sets_of(truth, **LABELS))], UffChoice())
    assert "states no unit" in imported.doubts[0]


def test_facts_that_the_file_does_not_state_are_required(tmp_path: Path, plate: Frf) -> None:
    unknown = {"ordinate_spec_data_type": 0, "orddenom_spec_data_type": 0}
    path = write_sets(tmp_path / "a.uff", *sets_of(plate, **unknown, **LABELS))
    with pytest.raises(InputError, match=r'does not state what its FRF is .* write unit = "m/s\^2/N"'):
        read_frf_uff(path)
    frf = import_uffs([path], UffChoice(unit="um/N")).frf
    assert frf.quantity == "receptance"
    np.testing.assert_allclose(frf.values, plate.values * 1e-6, rtol=1e-10)
    with pytest.raises(InputError, match="calls itself accelerance but has the unit um / N"):
        read_frf_uff(write_sets(tmp_path / "b.uff", *sets_of(plate, ordinate_axis_units_lab="um")))


def test_nodes_of_components_rotations_and_places(tmp_path: Path, plate: Frf) -> None:
    x, h = plate.frequencies, plate.values[:, 0, 0]
    wing = function(x, h, "1:+Z", "7:-X", rsp_ent_name="WING")
    tail = function(x, 2 * h, "1:+Z", "7:-X", rsp_ent_name="TAIL")
    frf = read_frf_uff(write_sets(tmp_path / "a.uff", wing, tail))
    assert (frf.responses, frf.excitations) == (("WING.1:+Z", "TAIL.1:+Z"), ("7:-X",))
    turning = function(x, h, "1:+Z", "7:-X", rsp_dir=5)
    path = write_sets(tmp_path / "b.uff", wing, turning)
    with pytest.raises(FileFormatError, match=r"data set 2: 1:\+RY is a rotation"):
        read_frf_uff(path)
    frf = import_uffs([path], UffChoice(responses=("1:+Z",))).frf
    assert frf.responses == ("1:+Z",)
    nameless = [function(x, k * h, "1:+Z", "1:+Z", rsp_node=0, rsp_dir=0, ref_node=0, ref_dir=0) for k in (1, 2)]
    path = write_sets(tmp_path / "c.uff", *nameless)
    with pytest.raises(FileFormatError, match="twice"):
        read_frf_uff(path)
    places = {1: ("A:+X", "H:+X"), 2: ("B:+X", "H:+X")}
    frf = import_uffs([path], UffChoice(places=places)).frf
    assert frf.responses == ("A:+X", "B:+X")
    np.testing.assert_allclose(frf.values[:, 1, 0], 2 * h, rtol=1e-10)


def test_our_own_files_keep_coherences_numbers_and_odd_names(tmp_path: Path, plate: Frf) -> None:
    coherence = np.random.default_rng(0).uniform(0.2, 1.0, plate.values.shape)
    labels = ("12:+Z", "TIP A/B:-X", "3:+RY", "4:+S", "5:+Z", "6:+Z")
    truth = replace(
        plate, coherence=coherence, multiple_coherence=coherence.max(axis=2), responses=labels, quantity="transfer",
        unit="m/V"
    )  # fmt: skip
    for binary in (True, False):
        write_frf_uff(tmp_path / "a.uff", truth, binary=binary)
        sets = [each for each in pyuff.UFF(str(tmp_path / "a.uff")).read_sets() if each["func_type"] == 4]
        assert [each["rsp_node"] for each in sets[::2]] == [12, 7, 3, 4, 5, 6]
    truth = replace(truth, responses=("12:+Z", "TIP A/B:-X", "3:-Y", "4:+S", "5:+Z", "6:+Z"))
    for binary in (True, False):
        write_frf_uff(tmp_path / "a.uff", truth, binary=binary)
        result = read_frf_uff(tmp_path / "a.uff")
        assert (result.responses, result.excitations, result.unit) == (truth.responses, truth.excitations, "m/V")
        assert result.coherence is not None
        assert result.multiple_coherence is not None
        np.testing.assert_allclose(result.coherence, coherence, rtol=1e-10)
        np.testing.assert_allclose(result.multiple_coherence, coherence.max(axis=2), rtol=1e-10)


def test_coherences_without_reference_in_another_file_or_of_nobody(tmp_path: Path, plate: Frf) -> None:
    truth = accelerance(plate)
    x, known = truth.frequencies, np.linspace(0.1, 1.0, 400)
    frfs = write_sets(tmp_path / "h.uff", *sets_of(truth)[::2])  # one reference
    none = {"ref_node": 0, "ref_dir": 0}
    single = [coherence_of(x, k * known / 6, f"{k}:+Z", "1:+Z") | none for k in range(1, 7)]
    imported = import_uffs([frfs, write_sets(tmp_path / "c.uff", *single)], UffChoice())
    assert imported.frf.coherence is not None
    np.testing.assert_allclose(imported.frf.coherence[:, :, 0], known[:, None] * np.arange(1, 7) / 6, rtol=1e-10)
    assert imported.doubts == ()
    stray = coherence_of(x, known, "9:+Z", "1:+Z")
    imported = import_uffs([frfs, write_sets(tmp_path / "c.uff", *single, stray)], UffChoice())
    assert imported.doubts == ("h.uff: coherence of 9:+Z / 1:+Z belongs to none of the FRFs and is left out",)
    with pytest.raises(FileFormatError, match=r"c.uff, data set 7 gives the coherence of 1:\+Z / 0:\+S twice"):
        import_uffs([frfs, write_sets(tmp_path / "c.uff", *single, single[0])], UffChoice())
    chosen = UffChoice(responses=("2:+Z",), excitations=("1:+Z",))
    imported = import_uffs([write_sets(tmp_path / "b.uff", *sets_of(truth)[::2], *single)], chosen)
    assert imported.doubts == ()
    assert imported.frf.coherence is not None
    np.testing.assert_allclose(imported.frf.coherence[:, 0, 0], known / 3, rtol=1e-10)
    short = coherence_of(x[:-1], known[:-1], "1:+Z", "1:+Z")
    with pytest.raises(FileFormatError, match=r"1:\+Z / 1:\+Z has 400 lines, its coherence 399"):
        import_uffs([frfs, write_sets(tmp_path / "c.uff", short)], UffChoice())


@pytest.mark.parametrize("uneven", [False, True])
def test_lines_filled_with_blanks_and_exponents_of_fortran(tmp_path: Path, plate: Frf, uneven: bool) -> None:
    """pyuff stumbles over both; the numbers are then read here."""
    truth = accelerance(plate)
    axis = truth.frequencies + (0.01 * np.arange(400) ** 1.5 if uneven else 0)
    truth = replace(truth, frequencies=axis)
    write_frf_uff(tmp_path / "a.uff", truth, binary=False)
    lines = (tmp_path / "a.uff").read_text().split("\n")
    filled = [line.replace("e+", "D+").replace("e-", "D-") if len(line) < 80 else line for line in lines]
    (tmp_path / "b.uff").write_text("\n".join(line.ljust(80) for line in filled))
    result = read_frf_uff(tmp_path / "b.uff")
    np.testing.assert_allclose(result.values, truth.values, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(result.frequencies, axis, rtol=1e-7)
    single = write_sets(tmp_path / "c.uff", *sets_of(truth, ord_data_type=5))
    np.testing.assert_allclose(read_frf_uff(single).values, truth.values, rtol=1e-5)


def damaged(text: bytes, how: str) -> bytes:
    lines = text.splitlines(keepends=True)
    if how == "cut":
        return text[: len(text) * 7 // 10]
    if how == "points":
        return b"".join(lines[:20] + lines[25:])
    if how == "nan":
        return text.replace(lines[30][:20], b"                 NaN", 1)
    return text.replace(lines[40], b"x" * 80 + b"\n", 1)


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("cut", "cut short"),
        ("points", r"data set 1 announces 400 points and holds 39\d"),
        ("nan", r"1:\+Z / 1:\+Z holds nan at .* Hz"),
        ("words", "data set 1 .* cannot be read|announces 400"),
    ],
)
def test_damaged_files_end_in_one_line(tmp_path: Path, plate: Frf, how: str, message: str) -> None:
    path = write_sets(tmp_path / "a.uff", *sets_of(accelerance(plate)))
    path.write_bytes(damaged(path.read_bytes(), how))
    with pytest.raises(FileFormatError, match=message) as caught:
        read_frf_uff(path)
    assert "\n" not in str(caught.value)


def test_entries_that_do_not_make_a_matrix(tmp_path: Path, plate: Frf) -> None:
    sets = sets_of(accelerance(plate))
    with pytest.raises(FileFormatError, match=r"6 responses and 2 excitations lacks 3:\+Z / 1:\+Z, 5:\+Z / 2:\+Z;"):
        read_frf_uff(write_sets(tmp_path / "a.uff", *sets[:4], *sets[5:9], *sets[10:]))
    with pytest.raises(FileFormatError, match=r"data set 13 gives 1:\+Z / 1:\+Z twice, as a.uff, data set 1 does"):
        read_frf_uff(write_sets(tmp_path / "a.uff", *sets, sets[0]))
    other = function(plate.frequencies[:-9], plate.values[:-9, 0, 0], "9:+Z", "1:+Z")
    with pytest.raises(FileFormatError, match=r"391 lines from 0.5 to 195.5 Hz, .* 400 lines from 0.5 to 200 Hz"):
        read_frf_uff(write_sets(tmp_path / "a.uff", *sets, other))
    spectrum = coherence_of(plate.frequencies, np.ones(400), "1:+Z", "1:+Z")
    with pytest.raises(FileFormatError, match=r"no FRF .* but function types 6"):
        read_frf_uff(write_sets(tmp_path / "a.uff", spectrum))
