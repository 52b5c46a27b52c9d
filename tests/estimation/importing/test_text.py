"""FRFs in text files: analysers' exports of any layout, merged to a matrix, and files that are damaged."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from estimation import Frf, FrfMapping, ImportedFrf, import_frf
from millfrf.core import FileFormatError, InputError
from tests.estimation.importing.conftest import accelerance

SIGNALCALC = (
    "Units: Ratio\nRef Chan:Resp Chan\t0-Z:0-Z\nChannel Name\t : \n\n"
    "Frequency\t Real\t Imaginary\n\nUnits:\nHz\t(m/s²)(N)\t \n"
)
"""Header of a DataPhysics SignalCalc export, its numbers in columns between tabulators."""


def mapping(text: dict[str, object], **more: object) -> FrfMapping:
    return FrfMapping.model_validate({"frf": text, **more})


def imported_frf(path: Path, **frf: object) -> ImportedFrf:
    return import_frf([path], mapping({"responses": ["3:+Z"], "excitations": ["1:+Z"], **frf}))


def rows(*columns: np.ndarray, delimiter: str = "\t", decimal: str = ".", digits: int = 12) -> str:
    lines = (delimiter.join(f"{x:.{digits}e}" for x in row) for row in zip(*columns, strict=True))
    return "\n".join(lines).replace(".", decimal) + "\n"


@pytest.fixture
def truth(plate: Frf) -> Frf:
    """Accelerance of point 3 at point 1."""
    return accelerance(plate)


def column(frf: Frf) -> np.ndarray:
    return frf.values[:, 2, 0]


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
def test_an_export_states_its_columns_and_its_unit(tmp_path: Path, truth: Frf, packed: bool, encoding: str) -> None:
    h = column(truth)
    data = (SIGNALCALC + rows(truth.frequencies, h.real, h.imag)).encode(encoding)
    path = tmp_path / ("a.txt.gz" if packed else "a.txt")
    path.write_bytes(gzip.compress(data) if packed else data)
    result = imported_frf(path)
    assert (result.frf.responses, result.frf.excitations, result.frf.quantity) == (("3:+Z",), ("1:+Z",), "accelerance")
    np.testing.assert_allclose(result.frf.values[:, 0, 0], h, rtol=1e-11)
    np.testing.assert_allclose(result.frf.frequencies, truth.frequencies, rtol=1e-11)
    assert "frequency = 1, real = 2, imaginary = 3" in result.inferred[0]
    assert "taken as accelerance, from the unit (m/s²)(N)" in result.inferred[1]


@pytest.mark.parametrize(
    ("header", "delimiter", "decimal"),
    [
        ("Frequency [Hz];Real [g/N];Imag [g/N];Coherence []\n", ";", ","),
        ("Frequency (Hz),Real (g/N),Imaginary (g/N),Coherence\n", ",", "."),
        ("# exported\n# Freq (Hz)\tRe(H) (g/N)\tIm(H) (g/N)\tCoh\n", "\t", "."),
        ("title\n\nfrequency,real (g/N),imag (g/N),coherence\n", ",", "."),
        ('"Frequency (Hz)";"Real part (g/N)";"Imaginary part (g/N)";"Coherence (-)"\n', ";", "."),
    ],
)
def test_layouts_of_tables(tmp_path: Path, truth: Frf, header: str, delimiter: str, decimal: str) -> None:
    h, coherence = column(truth) / 9.80665, np.linspace(0.3, 1, 400)
    text = header + rows(truth.frequencies, h.real, h.imag, coherence, delimiter=delimiter, decimal=decimal)
    (tmp_path / "a.csv").write_text(text)
    result = imported_frf(tmp_path / "a.csv", averages=8).frf
    np.testing.assert_allclose(result.values[:, 0, 0], column(truth), rtol=1e-11)
    assert result.coherence is not None
    assert result.averages is not None
    np.testing.assert_allclose(result.coherence[:, 0, 0], coherence, rtol=1e-11)
    np.testing.assert_array_equal(result.averages, [[8]])
    assert result.entry_variance() is not None


def test_magnitude_and_phase_decibels_radians_and_kilohertz(tmp_path: Path, truth: Frf) -> None:
    h = column(truth)
    degrees = rows(truth.frequencies / 1e3, np.abs(h), np.degrees(np.angle(h)))
    (tmp_path / "a.txt").write_text("Freq (kHz)\tMagnitude (m/s^2/N)\tPhase (deg)\n" + degrees)
    np.testing.assert_allclose(imported_frf(tmp_path / "a.txt").frf.values[:, 0, 0], h, rtol=1e-10)
    decibels = rows(2 * np.pi * truth.frequencies, 20 * np.log10(np.abs(h)), np.angle(h))
    (tmp_path / "b.txt").write_text("Freq (rad/s)\tMag (dB)\tPhase (rad)\n" + decibels)
    with pytest.raises(InputError, match="in decibels of no stated unit: write unit"):
        imported_frf(tmp_path / "b.txt")
    frf = imported_frf(tmp_path / "b.txt", unit="m/s^2/N").frf
    np.testing.assert_allclose(frf.values[:, 0, 0], h, rtol=1e-10)
    np.testing.assert_allclose(frf.frequencies, truth.frequencies, rtol=1e-10)
    (tmp_path / "c.txt").write_text(decibels)
    stated = {"frequency": 1, "magnitude": 2, "phase": 3, "frequency_unit": "rad/s", "unit": "m/s^2/N"}
    with pytest.raises(InputError, match='unit of the phase is not stated; write phase_unit = "deg" or "rad"'):
        imported_frf(tmp_path / "c.txt", **stated)
    with pytest.raises(InputError, match="if it is in dB, write decibels = true"):
        imported_frf(tmp_path / "c.txt", **stated, phase_unit="rad")
    frf = imported_frf(tmp_path / "c.txt", **stated, phase_unit="rad", decibels=True).frf
    np.testing.assert_allclose(frf.values[:, 0, 0], h, rtol=1e-10)


def test_conjugates_steps_and_windows_by_the_mapping(tmp_path: Path, truth: Frf) -> None:
    h = column(truth)
    (tmp_path / "a.dat").write_text(rows(h.real, -h.imag, delimiter=" "))
    steps = {"frequency_step_hz": 0.5, "frequency_start_hz": 0.5, "exponential_time_constant_s": 0.7}
    result = imported_frf(tmp_path / "a.dat", real=1, imaginary=2, unit="m/s^2/N", conjugate=True, **steps).frf
    np.testing.assert_allclose(result.values[:, 0, 0], h, rtol=1e-11)
    np.testing.assert_allclose(result.frequencies, truth.frequencies)
    assert result.exponential_time_constant == 0.7
    result = imported_frf(
        tmp_path / "a.dat", real=1, imaginary=2, quantity="transfer", unit="m/V", frequency_step_hz=1.0
    ).frf
    assert (result.quantity, result.unit) == ("transfer", "m/V")


def write_all(folder: Path, frf: Frf) -> tuple[list[Path], list[dict[str, object]]]:
    """One file an entry, in an order that is not the matrix's."""
    paths, entries = [], []
    for p, response in enumerate(frf.responses):
        for q, excitation in enumerate(frf.excitations):
            h = frf.values[:, p, q]
            paths.append(folder / f"run{p}{q}.txt")
            paths[-1].write_text(SIGNALCALC + rows(frf.frequencies, h.real, h.imag), encoding="utf-8")
            entries.append({"file": paths[-1].name, "response": response, "excitation": excitation})
    return paths, entries


def test_one_file_an_entry_makes_a_matrix(tmp_path: Path, truth: Frf) -> None:
    paths, entries = write_all(tmp_path, truth)
    entries[3]["averages"] = 5
    result = import_frf(paths[::-1], mapping({}, entries=entries))
    assert (result.frf.responses, result.frf.excitations) == (truth.responses, truth.excitations)
    np.testing.assert_allclose(result.frf.values, truth.values, rtol=1e-11)
    assert result.frf.averages is not None
    assert result.frf.averages.ravel().tolist() == [0, 0, 0, 5] + [0] * 8
    assert result.inferred[0].startswith("run00.txt and 11 more: ")


def test_columns_of_one_table_make_a_matrix(tmp_path: Path, truth: Frf) -> None:
    h = truth.values[:, :2].reshape(400, 4)
    header = "f," + ",".join(f"H{k} re,H{k} im" for k in range(4)) + "\n"
    parts = np.stack([h.real, h.imag], axis=2).reshape(400, 8).T
    (tmp_path / "a.csv").write_text(header + rows(truth.frequencies, *parts, delimiter=","))
    entries = [
        {"response": f"{1 + k // 2}:+Z", "excitation": f"{1 + k % 2}:+Z", "real": f"H{k} re", "imaginary": 3 + 2 * k}
        for k in range(4)
    ]
    result = import_frf([tmp_path / "a.csv"], mapping({"frequency": "f", "unit": "m/s^2/N"}, entries=entries))
    np.testing.assert_allclose(result.frf.values, truth.values[:, :2], rtol=1e-11)
    assert result.inferred == ("a.csv: 400 rows read from lines 2 to 401",)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda e: e[:-1], r"no entry of the mapping names the file run51.txt"),
        (lambda e: [*e, e[0] | {"file": "run99.txt"}], r"entry of file run99.txt has no such input"),
        (lambda e: [*e[:-1], e[-1] | {"response": "1:+Z"}], r"run51.txt gives 1:\+Z / 2:\+Z twice, as run01.txt does"),
        (
            lambda e: [*e[:-1], e[-1] | {"response": "9:+Z"}],
            r"7 responses and 2 excitations lacks 9:\+Z / 1:\+Z, 6:\+Z",
        ),
        (lambda e: [*e[:-1], {k: v for k, v in e[-1].items() if k != "file"}], r"write file = \"NAME\" in each entry"),
    ],
)
def test_entries_and_files_must_belong_together(tmp_path: Path, truth: Frf, change: object, message: str) -> None:
    paths, entries = write_all(tmp_path, truth)
    assert callable(change)
    with pytest.raises(InputError, match=message) as caught:
        import_frf(paths, mapping({}, entries=change(entries)))
    assert "\n" not in str(caught.value)


def test_other_axes_and_other_quantities_are_refused(tmp_path: Path, truth: Frf) -> None:
    paths, entries = write_all(tmp_path, truth)
    good = paths[5].read_text(encoding="utf-8")
    paths[5].write_text("\n".join(good.splitlines()[:-3]) + "\n", encoding="utf-8")
    with pytest.raises(FileFormatError, match=r"run21.txt: 3:\+Z / 2:\+Z has 397 lines .* run00.txt has 400 lines"):
        import_frf(paths, mapping({}, entries=entries))
    paths[5].write_text(good.replace("(m/s²)(N)", "(m)(N)"), encoding="utf-8")
    with pytest.raises(
        InputError, match=r"different quantities: accelerance \(run00.txt\), .* receptance \(run21.txt\)"
    ):
        import_frf(paths, mapping({}, entries=entries))


def test_facts_that_nobody_states_are_required(tmp_path: Path, truth: Frf) -> None:
    h = column(truth)
    numbers = rows(truth.frequencies, h.real, h.imag)
    (tmp_path / "a.txt").write_text(SIGNALCALC + numbers, encoding="utf-8")
    (tmp_path / "b.txt").write_text(numbers)
    (tmp_path / "c.txt").write_text("Frequency\tReal\tImag\n" + numbers)
    with pytest.raises(InputError, match=r"of which response and excitation is it\? Write responses = "):
        import_frf([tmp_path / "a.txt"])
    with pytest.raises(InputError, match=r"which of the 2 files is which FRF\? .* \[\[entries\]\] file = \"a.txt\""):
        import_frf([tmp_path / "a.txt", tmp_path / "b.txt"])
    with pytest.raises(InputError, match=r"which of its columns 1, 2, 3 is the FRF\? Write values"):
        imported_frf(tmp_path / "b.txt")
    with pytest.raises(InputError, match=r"which of its columns 1, 2, 3 is the frequency\?"):
        imported_frf(tmp_path / "b.txt", real=2, imaginary=3)
    with pytest.raises(InputError, match=r'in no stated unit: write unit = "m/s\^2/N"'):
        imported_frf(tmp_path / "c.txt")
    with pytest.raises(InputError, match="is that of receptance, not of accelerance"):
        imported_frf(tmp_path / "c.txt", unit="um/N", quantity="accelerance")
    with pytest.raises(InputError, match="force over motion; give the FRF, its inverse"):
        imported_frf(tmp_path / "c.txt", unit="N/um")
    with pytest.raises(InputError, match=r"real = 'Re' is no column of it; it has 1 Frequency, 2 Real, 3 Imag"):
        imported_frf(tmp_path / "c.txt", real="Re", imaginary="Imag", unit="m/N")
    with pytest.raises(InputError, match="frequencies do not increase"):
        imported_frf(tmp_path / "b.txt", frequency=2, real=1, imaginary=3, unit="m/N")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text[:-25], "cut short|does not end in rows|is not like"),
        (
            lambda text: text[: text.index("\n", 900)] + "\nend of file\n",
            "'end of file' is not like the rows .* does not end in rows",
        ),
        (
            lambda text: _replaced(text, 100, "1.0\toverload\t0.1"),
            r"line 101, column 2: 'overload' is not a number .* is not like the rows",
        ),
        (lambda text: _replaced(text, 100, "1.0\t2.0"), r"line 101 has 2 columns, .* is not like the rows"),
        (lambda text: _replaced(text, 100, "4.650e+01\tnan\t0.1"), r"a.txt: 3:\+Z / 1:\+Z holds nan at 46.5 Hz"),
        (
            lambda text: _replaced(text, 100, "4.600e+01\t1\t0.1"),
            r"frequencies do not increase \(46 Hz is followed by 46",
        ),
        (lambda text: text[:100], "holds no rows of numbers"),
        (lambda text: "", "holds no rows of numbers .* empty"),
    ],
)
def test_damaged_texts_end_in_one_line(tmp_path: Path, truth: Frf, change: object, message: str) -> None:
    h = column(truth)
    text = SIGNALCALC + rows(truth.frequencies, h.real, h.imag)
    assert callable(change)
    (tmp_path / "a.txt").write_text(change(text), encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        imported_frf(tmp_path / "a.txt")
    assert "\n" not in str(caught.value)


def _replaced(text: str, number: int, line: str) -> str:
    """Line ``number``, counted from 0, replaced by another."""
    lines = text.split("\n")
    return "\n".join([*lines[:number], line, *lines[number + 1 :]])


@pytest.mark.parametrize("unit", ["", " (%)"])
def test_a_coherence_above_one_on_many_lines_is_refused_by_file_line_and_value(
    tmp_path: Path, truth: Frf, unit: str
) -> None:
    """Percent are one only where the heading says so."""
    h, coherence = column(truth), np.full(len(truth.frequencies), 98.0 if unit else 0.98)
    coherence[13:40] = 120.0 if unit else 1.2
    heading = f"Frequency (Hz)\tReal (m/s²/N)\tImaginary (m/s²/N)\tCoherence{unit}\n"
    path = tmp_path / "a.txt"
    path.write_text(heading + rows(truth.frequencies, h.real, h.imag, coherence))
    where = rf"a\.txt: 3:\+Z / 1:\+Z has a coherence of 1\.2 at {truth.frequencies[13]:g} Hz \(line 14 of"
    with pytest.raises(FileFormatError, match=where):
        imported_frf(path)
    coherence[13:40] = coherence[0]
    path.write_text(heading + rows(truth.frequencies, h.real, h.imag, coherence))
    result = imported_frf(path).frf.coherence
    assert result is not None
    np.testing.assert_allclose(result, 0.98)


def test_a_few_lines_with_a_coherence_above_one_are_left_out_with_one_doubt(tmp_path: Path, truth: Frf) -> None:
    """One such line refused the whole file."""
    h, coherence = column(truth), np.full(len(truth.frequencies), 0.98)
    coherence[[13, 14, 200]] = 1.0003, 1.002, -0.01
    heading = "Frequency (Hz)\tReal (m/s²/N)\tImaginary (m/s²/N)\tCoherence\n"
    path = tmp_path / "a.txt"
    path.write_text(heading + rows(truth.frequencies, h.real, h.imag, coherence))
    imported = imported_frf(path)
    assert np.flatnonzero(~imported.frf.valid).tolist() == [13, 14, 200]
    (doubt,) = [text for text in imported.doubts if "coherence" in text]
    at = f"{truth.frequencies[13]:.6g} Hz"
    assert doubt.startswith(f"3 of 400 lines, the first at {at}, have a coherence outside 0 to 1 (3:+Z / 1:+Z)")


def test_a_gzip_file_that_is_cut_is_refused_and_zero_hertz_is_not(tmp_path: Path, truth: Frf) -> None:
    h = np.concatenate([[np.nan], column(truth)])
    text = SIGNALCALC + rows(np.concatenate([[0.0], truth.frequencies]), h.real, h.imag)
    (tmp_path / "a.txt.gz").write_bytes(gzip.compress(text.encode())[:-2000])
    with pytest.raises(FileFormatError, match=r"a.txt.gz is damaged or cut short"):
        imported_frf(tmp_path / "a.txt.gz")
    (tmp_path / "a.txt.gz").write_bytes(gzip.compress(text.encode()))
    result = imported_frf(tmp_path / "a.txt.gz").frf
    assert result.valid.tolist() == [False] + [True] * 400
