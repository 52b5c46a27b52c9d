"""Frequency axes in any unit, in texts, MAT and UFF files: read in Hz, or refused by the name of the unit."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from estimation import FrfMapping, import_frf
from millfrf.core import InputError

N = 41
PER_HERTZ = {"Hz": 1.0, "kHz": 1e-3, "rad/s": 2 * np.pi, "CPM": 60.0, "RPM": 60.0, "order": 0.02, "furlong": 3.0}
CERTAIN = ("Hz", "kHz", "rad/s", "CPM")
MAPPING = {"responses": ["1:+Z"], "excitations": ["1:+Z"], "unit": "m/s^2/N"}


def truth(frequencies: np.ndarray) -> np.ndarray:
    w, w0 = 2 * np.pi * frequencies, 2 * np.pi * 30.0
    return -(w**2) / (12.0 * (w0**2 - w**2 + 2j * 0.03 * w0 * w))


def uff_text(axis: np.ndarray, values: np.ndarray, unit: str, *, even: bool, padded: bool, kind: int) -> str:
    """Data set 58 as its definition lays it out, written by hand."""
    step = axis[1] - axis[0] if even else 0.0
    data_type = 5 if kind == 5 else 2
    columns = [] if even else [axis]
    columns += [values.real, values.imag] if kind == 5 else [np.abs(values)]
    numbers = [f"{x:13.5e}" for x in np.column_stack(columns).reshape(-1)]
    numbers += [f"{0.0:13.5e}"] * (-len(numbers) % 6 if padded else 0)
    lines = ["    -1", f"{58:6d}", "bench", "NONE", "01-Jan-26 10:00:00", "NONE", "NONE"]
    lines.append(f"{4:5d}{0:10d}{1:5d}{0:10d} {'NONE':<10}{1:10d}{3:4d} {'NONE':<10}{1:10d}{3:4d}")
    lines.append(f"{data_type:10d}{N:10d}{int(even):10d}{axis[0]:13.5e}{step:13.5e}{0.0:13.5e}")
    specific = {"Hz": 18, "kHz": 18, "RPM": 19}.get(unit, 0)
    for number, name, label in (
        (specific, "Axis", unit),
        (12, "Acceleration", "m/s^2"),
        (13, "Force", "N"),
        (0, "NONE", "NONE"),
    ):
        lines.append(f"{number:10d}{0:5d}{0:5d}{0:5d} {name:<20} {label:<20}")
    lines += ["".join(numbers[k : k + 6]) for k in range(0, len(numbers), 6)]
    return "\n".join([*lines, "    -1", ""])


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    unit=st.sampled_from(sorted(PER_HERTZ)),
    even=st.booleans(),
    padded=st.booleans(),
    first=st.sampled_from([0.0, 4.0]),
    step=st.sampled_from([0.5, 2.0, 12.5]),
    kind=st.sampled_from(["uff", "csv", "row of units"]),
)
def test_an_axis_is_in_hertz_or_refused_by_its_unit(
    tmp_path: Path, unit: str, even: bool, padded: bool, first: float, step: float, kind: str
) -> None:
    f = first + step * np.arange(N)
    axis, h = f * PER_HERTZ[unit], truth(f)
    if kind == "uff":
        path = tmp_path / "a.uff"
        path.write_text(uff_text(axis, h, unit, even=even, padded=padded, kind=5))
    else:
        path = tmp_path / "a.csv"
        heads = [f"Frequency ({unit})" if kind == "csv" else "Frequency", "Real", "Imaginary"]
        rows = [";".join(heads), *([f"{unit};-;-"] if kind != "csv" else [])]
        rows += [f"{x:.9e};{z.real:.9e};{z.imag:.9e}" for x, z in zip(axis, h, strict=True)]
        path.write_text("\n".join(rows) + "\n")
    mapping = FrfMapping.model_validate({"frf": {} if kind == "uff" else MAPPING})
    if unit not in CERTAIN:
        with pytest.raises(InputError, match=f"{unit}.*frequency_unit = "):
            import_frf([path], mapping)
        if unit != "RPM":
            return
        mapping = FrfMapping.model_validate(
            {"frf": {**(mapping.frf.model_dump(exclude_defaults=True)), "frequency_unit": "rpm"}}
        )
    frf = import_frf([path], mapping).frf
    np.testing.assert_allclose(frf.frequencies, f, rtol=2e-5, atol=1e-4)
    lines = frf.valid & (f > 0)
    np.testing.assert_allclose(frf.values[lines, 0, 0], h[lines], rtol=2e-5, atol=1e-7)


def test_magnitudes_alone_are_refused(tmp_path: Path) -> None:
    f = np.arange(1.0, N + 1)
    (tmp_path / "a.uff").write_text(uff_text(f, truth(f), "Hz", even=True, padded=False, kind=2))
    with pytest.raises(InputError, match="magnitude or a real part alone is no FRF"):
        import_frf([tmp_path / "a.uff"])


@pytest.mark.parametrize(("name", "factor"), [("f", 1.0), ("f_kHz", 1e-3), ("omega_rad_s", 2 * np.pi), ("w", None)])
def test_an_array_is_in_the_unit_of_its_name(tmp_path: Path, name: str, factor: float | None) -> None:
    f = np.arange(1.0, N + 1)
    savemat(tmp_path / "a.mat", {name: f * (factor or 2 * np.pi), "H": truth(f)})
    mapping = FrfMapping.model_validate({"frf": MAPPING})
    if factor is None:
        with pytest.raises(InputError, match='named like an angular frequency; write frequency_unit = "rad/s"'):
            import_frf([tmp_path / "a.mat"], mapping)
        mapping = FrfMapping.model_validate({"frf": {**MAPPING, "frequency_unit": "rad/s"}})
    np.testing.assert_allclose(import_frf([tmp_path / "a.mat"], mapping).frf.frequencies, f, rtol=1e-12)


def test_a_unit_that_the_file_says_otherwise_is_a_doubt(tmp_path: Path) -> None:
    f = np.arange(1.0, N + 1)
    rows = [f"{x};{z.real};{z.imag}" for x, z in zip(f, truth(f), strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["Frequency (Hz);Real (g/N);Imaginary (g/N)", *rows]) + "\n")
    imported = import_frf([tmp_path / "a.csv"], FrfMapping.model_validate({"frf": MAPPING}))
    assert imported.doubts == (
        "a.csv says g/N: 9.81 times what the mapping says (m/s^2/N), which was taken; correct one of the two",
    )
