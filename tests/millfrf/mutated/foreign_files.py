"""Small files of other programs, and the mappings that read them."""

import shutil
from pathlib import Path

import h5py
import numpy as np
from scipy.io import savemat, wavfile

from estimation import Frf, write_frf_uff

ROWS = np.random.default_rng(0).standard_normal((200, 2))
FRF_MAPPING = """[frf]
responses = ["TCP:+X"]
excitations = ["TCP:+X"]
unit = "m/N"
"""


def make_foreign_files(folder: Path) -> None:
    """Write them next to ``cell.dbc`` and ``log.toml``."""
    _recordings(folder)
    _frfs(folder)
    _times(folder / "times.uff")


def _recordings(folder: Path) -> None:
    import asammdf
    import can
    from nptdms import ChannelObject, TdmsWriter

    column = '[[channels]]\nname = "fx"\nquantity = "force"\nunit = "N"\ncolumn = 1\n'
    array = "sample_rate = 100.0\n" + column.replace("column", 'array = "x"\ncolumn')
    savemat(folder / "packed.mat", {"x": ROWS, "s": {"gain": 2.0, "name": "text"}}, do_compression=True)
    with h5py.File(folder / "newer.mat", "w") as file:
        file.create_dataset("x", data=ROWS, chunks=(50, 2), compression="gzip")
        file["x"].attrs["MATLAB_class"] = np.bytes_(b"double")
    wavfile.write(folder / "sound.wav", 100, (1000 * ROWS).astype(np.int16))
    with TdmsWriter(folder / "log.tdms") as writer:
        writer.write_segment([ChannelObject("g", "x", ROWS[:, 0], properties={"wf_increment": 0.01})])
    with can.Logger(folder / "log.blf") as log:
        for k in range(30):
            log(can.Message(1.7e9 + 0.1 * k, 256, is_extended_id=False, data=bytes([k] * 8), channel=0))
    with asammdf.MDF() as file:
        file.append([asammdf.Signal(ROWS[:, 0], 0.01 * np.arange(len(ROWS)), name="x", unit="N")], acq_name="g")
        file.save(folder / "log.mf4", overwrite=True)
    np.save(folder / "own.npy", ROWS)
    shutil.copy(folder / "cell.dbc", folder / "other.dbc")
    texts = {
        "x.toml": array,
        "wav.toml": column,
        "tdms.toml": "sample_rate = 100.0\n" + column,
        "mf4.toml": column.replace("column", 'array = "g/x"\ncolumn'),
        "npy.toml": "sample_rate = 100.0\n" + column,
        "replay.toml": '[device]\ndriver = "replay"\nfile = "mutated_up.h5"\nspeed = 50.0\n',
        "other.toml": (folder / "log.toml").read_text(encoding="utf-8").replace("cell.dbc", "other.dbc"),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


def _frfs(folder: Path) -> None:
    lines = np.arange(1.0, 101.0)
    values = 1e-6 / (1.0 - (lines / 40.0) ** 2 + 0.05j * lines / 40.0)
    table = np.column_stack([lines, values.real, values.imag])
    np.savetxt(folder / "frf.csv", table, delimiter=",", header="Frequency [Hz],Real,Imaginary", comments="")
    np.savez(folder / "frf.npz", f=lines, h=values)
    (folder / "frf.toml").write_text(FRF_MAPPING + "frequency = 1\nreal = 2\nimaginary = 3\n", encoding="utf-8")
    (folder / "array.toml").write_text(FRF_MAPPING + 'frequency = "f"\nvalues = "h"\n', encoding="utf-8")
    dofs, valid = ("TCP:+X",), np.ones(len(lines), dtype=bool)
    frf = Frf(lines, values[:, None, None], dofs, dofs, "receptance", "m/N", valid, None, None)
    write_frf_uff(folder / "text.uff", frf, binary=False)


def _times(path: Path) -> None:
    import pyuff

    record = pyuff.prepare_58(
        func_type=1, rsp_node=1, rsp_dir=3, ref_node=0, ref_dir=0, binary=0, abscissa_spacing=1,
        abscissa_inc=0.01, abscissa_min=0.0, num_pts=len(ROWS), ordinate_spec_data_type=8,
        orddenom_spec_data_type=0, ord_data_type=4, x=0.01 * np.arange(len(ROWS)), data=ROWS[:, 0], id1="a",
        rsp_ent_name="a", ref_ent_name="a", abscissa_axis_units_lab="s", ordinate_axis_units_lab="m",
    )  # fmt: skip
    pyuff.UFF(str(path)).write_sets(record, "overwrite")
