"""TDMS and MDF files become recordings, and what is not read of a file is said."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import pyuff
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

from acquisition import Recording, convert
from millfrf.core import FileFormatError, InputError
from millfrf.core.runtime import notices_to

MAPPING = """sample_rate = 1024.0
[[channels]]
name = "fx"
array = "Analog/Force"
quantity = "force"
unit = "kN"
node = "TCP"
direction = "+X"
[[channels]]
name = "ax"
array = "Analog/Acceleration"
quantity = "acceleration"
unit = "g"
node = "TCP"
direction = "+X"
"""


def test_channels_by_group_and_name_in_si(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    force, motion = rng.standard_normal((2, 3000))
    with TdmsWriter(tmp_path / "cut.tdms") as writer:
        for part in (slice(0, 1000), slice(1000, None)):  # several segments, as a running acquisition writes them
            writer.write_segment(
                [ChannelObject("Analog", "Force", force[part]), ChannelObject("Analog", "Acceleration", motion[part])]
            )
    (tmp_path / "map.toml").write_text(MAPPING, encoding="utf-8")
    convert(tmp_path / "cut.tdms", tmp_path / "cut.h5", tmp_path / "map.toml")
    with Recording(tmp_path / "cut.h5") as recording:
        samples = recording.stream().read()
        assert recording.stream().sample_rate == 1024.0
    np.testing.assert_allclose(samples[:, 0], 1e3 * force, rtol=1e-6)
    np.testing.assert_allclose(samples[:, 1], 9.80665 * motion, rtol=1e-6)


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bad.tdms").write_bytes(b"TDSm" + bytes(range(200)))
    (tmp_path / "map.toml").write_text(MAPPING, encoding="utf-8")
    with pytest.raises(FileFormatError, match=r"bad\.tdms"):
        convert(tmp_path / "bad.tdms", tmp_path / "out.h5", tmp_path / "map.toml")
    assert not (tmp_path / "out.h5").exists()


@pytest.mark.parametrize("fault", ["none", "gap", "jitter", "other gap"])
def test_mdf_states_units_and_times(tmp_path: Path, fault: str) -> None:
    asammdf = pytest.importorskip("asammdf")
    rows = np.arange(2000) if fault in ("none", "jitter") else np.delete(np.arange(2000), np.arange(700, 760))
    times = -0.125 + rows / 1000 + (0.0004 * (rows % 2) if fault == "jitter" else 0.0)
    force, motion = np.random.default_rng(1).standard_normal((2, len(rows)))
    signals = [
        asammdf.Signal(force, times, name="Fz", unit="kN"),
        asammdf.Signal(motion, times + 0.1 * (fault == "other gap"), name="acc_z", unit="g"),
    ]
    with asammdf.MDF(version="4.10") as file:
        for group in [signals] if fault != "other gap" else [signals[:1], signals[1:]]:
            file.append(group, acq_name="fast")
        state = asammdf.Signal(np.array([b"ok", b"no"]), np.array([0.0, 1.3]), name="state", encoding="latin-1")
        file.append([state], acq_name="slow")
        file.save(tmp_path / "cut.mf4", overwrite=True)
    said: list[str] = []
    if fault in ("jitter", "other gap"):
        with pytest.raises(InputError, match=r"not evenly spaced|began at different times, and 60 samples"):
            convert(tmp_path / "cut.mf4", tmp_path / "cut.h5")
        return
    with notices_to(said.append):
        convert(tmp_path / "cut.mf4", tmp_path / "cut.h5")
    with Recording(tmp_path / "cut.h5") as recording:
        stream = recording.stream()
        samples = stream.read()[rows]
        assert (stream.n_samples, stream.sample_rate, stream.start_time) == (2000, 1000.0, -0.125)
    np.testing.assert_allclose(samples, np.column_stack([1e3 * force, 9.80665 * motion]), rtol=1e-12)
    assert any("slow/state (no series of numbers)" in line for line in said)
    assert any("60 samples (0.06 s) missing after row 700" in line for line in said) == (fault == "gap")


FILES = {
    "cut.csv": "2000 rows read from lines 2 to 2001; not used: column 4 temp (degC)",
    "cut.lvm": "2000 rows read from lines 4 to 2003; not used: column 4 temp (degC)",
    "cut.mat": "2000 samples read; not used: temp 1x2000, K 3x3",
    "cut.npz": "2000 samples read; not used: temp 2000, K 3x3",
    "cut.tdms": "2000 samples read; not used: g/temp 2000",
    "cut.uff": "2000 samples read; not used: 3:+Z 2000, 1 function of type 4 (no time record)",
    "cut.xlsx": "2000 rows read from lines 2 to 2001; not used: column 4 temp (degC)",
    "cut.h5": "2000 samples read; not used: K 3x3, temp 2000",
}


@pytest.mark.parametrize("name", sorted(FILES))
def test_every_conversion_says_what_it_read_and_what_not(tmp_path: Path, name: str) -> None:
    """A mapping of two of three channels: the third is named, like everything else that is no channel."""
    if name.endswith(".xlsx"):
        pytest.importorskip("python_calamine")
    time = np.arange(2000) / 1024
    data = {"Fz": np.sin(300 * time), "acc_z": np.cos(200 * time), "temp": np.round(time) + 20}
    arrays = write_columns(tmp_path / name, time, data)
    tables = [
        f'[[channels]]\nname = "{key}"\nquantity = "{quantity}"\nunit = "{unit}"\n{place}\n'
        for (key, quantity, unit), place in zip(
            (("Fz", "force", "N"), ("acc_z", "acceleration", "m/s^2")), arrays, strict=True
        )
    ]
    clock = "" if name.endswith((".tdms", ".uff")) else "time = 1\n" if "column" in arrays[0] else 'time = "t"\n'
    (tmp_path / "map.toml").write_text(clock + "".join(tables))
    said: list[str] = []
    with notices_to(said.append):
        convert(tmp_path / name, tmp_path / "out.npz", tmp_path / "map.toml")
    assert f"{name}: {FILES[name]}" in said
    np.testing.assert_allclose(np.load(tmp_path / "out.npz")["samples"][:, 0], data["Fz"], rtol=1e-6, atol=1e-9)


def write_columns(path: Path, time: np.ndarray, data: dict[str, np.ndarray]) -> list[str]:
    """Write times and channels in the format of the suffix; return the place of the first two in a mapping."""
    more = {"K": np.eye(3)}
    heading = "t (s)\tFz (N)\tacc_z (m/s^2)\ttemp (degC)"
    rows = [[f"{x:.9f}" for x in row] for row in zip(time, *data.values(), strict=True)]
    if path.suffix in (".csv", ".lvm"):
        header = "LabVIEW Measurement\t\nSeparator\tTab\n" if path.suffix == ".lvm" else ""
        path.write_text(header + "\n".join([heading, *map("\t".join, rows)]) + "\n")
        return ["column = 2", "column = 3"]
    if path.suffix == ".xlsx":
        openpyxl = pytest.importorskip("openpyxl")
        book = openpyxl.Workbook()
        for row in [heading.split("\t"), *([float(cell) for cell in cells] for cells in rows)]:
            book.active.append(row)
        book.save(path)
        return ["column = 2", "column = 3"]
    if path.suffix == ".tdms":
        properties = {"wf_increment": 1 / 1024, "wf_start_offset": 0.0}
        with TdmsWriter(path) as writer:
            writer.write_segment([ChannelObject("g", key, values, properties) for key, values in data.items()])
        return ['array = "g/Fz"', 'array = "g/acc_z"']
    if path.suffix == ".uff":
        return write_uff(path, data)
    if path.suffix == ".npz":
        np.savez(path, t=time, **data, **more)
    elif path.suffix == ".mat":
        savemat(path, {"t": time, **data, **more})
    else:
        with h5py.File(path, "w") as file:
            for key, values in ({"t": time} | data | more).items():
                file[key] = values
    return ['array = "Fz"', 'array = "acc_z"']


def write_uff(path: Path, data: dict[str, np.ndarray]) -> list[str]:
    """Write time records at nodes 1 to 3, and an FRF, with pyuff."""
    for node, values in enumerate(data.values(), 1):
        record = pyuff.prepare_58(
            func_type=1, rsp_node=node, rsp_dir=3, ref_node=0, ref_dir=0, binary=0, abscissa_spacing=1,
            abscissa_inc=1 / 1024, abscissa_min=0.0, num_pts=len(values), ordinate_spec_data_type=0,
            orddenom_spec_data_type=0,
            ord_data_type=4, x=np.arange(len(values)) / 1024, data=values, id1="a", rsp_ent_name="a", ref_ent_name="a",
            abscissa_axis_units_lab="s", ordinate_axis_units_lab="NONE",
        )  # fmt: skip
        pyuff.UFF(str(path)).write_sets(record, "add" if node > 1 else "overwrite")
    frf = {**record, "func_type": 4, "ord_data_type": 6, "data": np.ones(50) + 1j, "x": np.arange(50.0), "num_pts": 50}
    pyuff.UFF(str(path)).write_sets(frf | {"abscissa_inc": 1.0, "abscissa_axis_units_lab": "Hz"}, "add")
    return ['array = "1:+Z"', 'array = "2:+Z"']
