"""Every kind of file that the product reads, small, with the command lines that read it."""

import importlib.util
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import h5py
import numpy as np
from scipy.io import savemat, wavfile


def _module(name: str, path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


_WRITING = _module("writing_commands_of_kinds", Path(__file__).parents[1] / "outputs" / "writing_commands.py")
ROBOT = Path(__file__).parents[3] / "millfrf" / "robot_model"
LOBES = "--cutting cut.toml --speeds 600 1200 2 --max-depth 0.01 --method zero-order --out out.csv"
ROWS = np.random.default_rng(0).standard_normal((200, 2))


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Parameters
    ----------
    file
        Good file of it.
    commands
        Command lines that read it as ``FILE``.
    text
        Whether it is text.
    """

    file: str
    commands: tuple[str, ...]
    text: bool = False


KINDS = (
    Kind("up.h5", ("inspect FILE", "estimate FILE --excitation fx --segment 4 --out out.h5", "convert FILE out.npz")),
    Kind("killed.h5", ("inspect FILE", "recover FILE --out out.h5")),
    Kind("older.h5", ("inspect FILE", "convert FILE out.csv")),
    Kind("frf_tip.h5", ("inspect FILE", "fit FILE --band 12 60 --out out.json", f"lobes FILE {LOBES}")),
    Kind("frf_tip.h5", ("calibrate model_process.json --tip FILE --sensor frf_housing.h5 --out out.json",)),
    Kind("frf_tip.h5", ("report FILE --out out.html", "convert FILE out.uff")),
    Kind("model_tip.json", ("inspect FILE", f"lobes FILE {LOBES}", "convert FILE out.unv"), text=True),
    Kind("model_tip.json", ("predict FILE steady.h5 --out out.h5", f"lobes FILE {LOBES}"), text=True),
    Kind("model_process.json", ("calibrate FILE --tip frf_tip.h5 --sensor frf_housing.h5 --out out.json",), text=True),
    Kind("fitted.json", ("inspect FILE", "report FILE --out out.html"), text=True),
    Kind("steady.h5", ("chatter FILE --cutting cut.toml --speed 800 --out out.json", "inspect FILE")),
    Kind("steady.h5", ("predict model_tip.json FILE --out out.h5",)),
    Kind("session.toml", ("acquire FILE --check --seconds 0.1",), text=True),
    Kind("wired.toml", ("acquire FILE --check --seconds 0.1",), text=True),
    Kind("plan.toml", ("plan FILE",), text=True),
    Kind("cut.toml", (f"lobes model_tip.json {LOBES.replace('cut.toml', 'FILE')}", "inspect FILE"), text=True),
    Kind("robot.toml", ("robot modes FILE",), text=True),
    Kind("map.toml", ("convert table.csv out.h5 --map FILE",), text=True),
    Kind("table.csv", ("convert FILE out.h5 --map map.toml",), text=True),
    Kind("own.csv", ("convert FILE out.h5",), text=True),
    Kind("lobes.csv", ("inspect FILE", "report FILE --out out.html"), text=True),
    Kind("chatter.json", ("inspect FILE", "report FILE --out out.html"), text=True),
    Kind("diagnosis.json", ("inspect FILE",), text=True),
    Kind("poles.json", ("fit frf_tip.h5 --band 12 60 --poles FILE --out out.json",), text=True),
    Kind("points.csv", ("convert FILE out.toml",), text=True),
    Kind("path.csv", ("robot compensate staubli_rx170 FILE --out out.csv",), text=True),
    Kind("given.uff", ("convert FILE out.h5",), text=True),
    Kind("given.unv", ("convert FILE out.json",), text=True),
    Kind("own.npz", ("convert FILE out.h5",)),
    Kind("own.mat", ("convert FILE out.h5",)),
    Kind("packed.mat", ("convert FILE out.h5 --map x.toml",)),
    Kind("newer.mat", ("convert FILE out.h5 --map x.toml",)),
    Kind("sound.wav", ("convert FILE out.h5 --map wav.toml",)),
    Kind("log.tdms", ("convert FILE out.h5 --map tdms.toml",)),
    Kind("log.asc", ("convert FILE out.h5 --map log.toml",), text=True),
    Kind("log.blf", ("convert FILE out.h5 --map log.toml",)),
    Kind("other.dbc", ("convert log.asc out.h5 --map other.toml",), text=True),
)


def make_kinds(folder: Path) -> None:
    """Write the good files."""
    from millfrf.command_line import run

    _WRITING.make_inputs(folder)
    for words in (
        "convert steady.h5 own.npz",
        "convert steady.h5 own.mat",
        f"lobes model_tip.json {LOBES.replace('out.csv', 'lobes.csv')}",
        "chatter steady.h5 --cutting cut.toml --speed 800 --out chatter.json",
        "fit frf_tip.h5 --band 12 60 --out fitted.json --candidates poles.json",
    ):
        named = [str(folder / word) if "." in word and word[0].isalpha() else word for word in words.split()]
        assert run(named) == 0, words
    _own_csv(folder)
    shutil.copy(next(ROBOT.rglob("staubli_rx170.toml")), folder / "robot.toml")
    _diagnosis(folder / "diagnosis.json")
    _foreign(folder)


def _diagnosis(path: Path) -> None:
    from millfrf.mismatch import AcceptedCause, Diagnosis, write_diagnosis
    from millfrf.mismatch.inference.diagnosis import Improvement, Remainder

    cause = AcceptedCause("gain", {"channel": "fx"}, {"gain": 1.1}, {"gain": 0.01}, 30.0)
    gain = Improvement("a.h5", 0.5, 0.5, 0.1, 0.05, 0.001, (0.2, 0.3))
    rest = Remainder(0.1, 2.0)
    write_diagnosis(path, Diagnosis("structure", "explained", (cause,), (), (), gain, rest, rest, {}, None))


def _own_csv(folder: Path) -> None:
    from millfrf.command_line import run

    part = str(folder / "part.h5")
    assert run(["convert", str(folder / "steady.h5"), part, "--span", "0", "1"]) == 0
    assert run(["convert", part, str(folder / "own.csv")]) == 0


def _foreign(folder: Path) -> None:
    """Files of other programs, and the mappings that read them."""
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
    shutil.copy(folder / "cell.dbc", folder / "other.dbc")
    texts = {
        "x.toml": array,
        "wav.toml": column,
        "tdms.toml": "sample_rate = 100.0\n" + column,
        "other.toml": (folder / "log.toml").read_text(encoding="utf-8").replace("cell.dbc", "other.dbc"),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    with h5py.File(folder / "older.h5", "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "millfrf.recording", 1
        file.attrs["title"], file.attrs["setup"] = "a title", "[tool]\nteeth = 2\n"
        group = file.create_group("signals/main")
        group.attrs["sample_rate"], group.attrs["start_time"] = 100.0, 0.0
        group.attrs["channels"] = '[{"name": "fx", "quantity": "force", "unit": "N"}]'
        group["samples"] = ROWS[:, :1].astype("f4")
        file["events/speed/time"], file["events/speed/value"] = [0.5, 1.0], [6000.0, 6001.0]
