"""Every kind of file that the product reads, small, with the command lines that read it."""

import importlib.util
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import h5py
import numpy as np

from acquisition import Channel, RecordingWriter, StreamDescription


def _module(name: str, path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


_WRITING = _module("writing_commands_of_kinds", Path(__file__).parents[1] / "outputs" / "writing_commands.py")
_FOREIGN = _module("foreign_files_of_kinds", Path(__file__).with_name("foreign_files.py"))
ROBOT = Path(__file__).parents[3] / "millfrf" / "robot_model"
LOBES = "--cutting cut.toml --speeds 600 1200 2 --max-depth 0.01 --method zero-order --out out.csv"
CUT_IDENTIFY = "--depth 0.001 --feeds 150e-6 --out out.toml"
CUT_DIAGNOSE = "--depth 0.001 --out out.cut"
DIAGNOSE = "--search-work 1 --out out.model"
AREA = "--x 1 1.1 2 --y 0 0.1 2"
ANGLED = "kuka_kr90_angled FILE --cutting cut.toml --speed 3000 --depth 0.001 --turns -9 0 2 --out out.csv"
LEARN = "--pose ready --pose 0,-30,110,0,70,0 --out out.json"
RUN_CAMPAIGN = "campaign campaign/campaign.toml --workers 0"
CAMPAIGN = """[campaign]
title = "One pose"
[[recordings]]
files = ["*_*.h5"]
pattern = '(?P<pose>P[0-9]+)_(?P<immersion>[a-z]+)'
[sets]
by = ["pose"]
[estimate]
segment = 4.0
part_s = 10.0
[fit]
band_hz = [13.0, 30.0]
"""
STORED = "campaign/campaign_results/results/*/*/*"
ROWS = np.random.default_rng(0).standard_normal((200, 2))


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Parameters
    ----------
    file
        Good file of it, or a pattern of several.
    commands
        Command lines that read it as ``FILE``.
    text
        Whether it is text.
    named
        Whether others name the file, so that a mutated one has its name.
    """

    file: str
    commands: tuple[str, ...]
    text: bool = False
    named: bool = False

    def good_file(self, folder: Path, turn: int) -> Path:
        """Return the good file, or one of several in turn if its name is a pattern."""
        files = sorted(folder.glob(self.file))
        return files[turn % len(files)]

    def mutated_file(self, good: Path) -> Path:
        """Return the path of a mutated file."""
        return good if self.named else good.with_name(f"mutated_{good.name}")


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
    Kind(
        "cut.toml",
        (
            f"cut identify FILE up.h5 {CUT_IDENTIFY}",
            "chatter steady.h5 --cutting FILE --speed 800 --out out.json",
            f"robot path {ANGLED.replace('FILE', 'cut_path.csv').replace('cut.toml', 'FILE')}",
            f"cut identify FILE up.h5 {CUT_IDENTIFY}",
            "report model_tip.json FILE --out out.html",
            f"cut diagnose FILE steady.h5 {CUT_DIAGNOSE}",
        ),
        text=True,
    ),
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
    Kind("other.dbc", ("convert log.asc out.h5 --map other.toml",), text=True, named=True),
    Kind("second.h5", ("inspect FILE", "recover FILE --out out.h5", "convert FILE out.mat")),
    Kind("up.h5", ("recover FILE --out out.h5", "acquire replay.toml --check --seconds 0.1")),
    Kind(
        "up.h5",
        (f"cut identify cut.toml FILE {CUT_IDENTIFY}", "fit FILE down.h5 central.h5 --band 13 30 --out out.json"),
    ),
    Kind(
        "steady.h5",
        (
            "report FILE --out out.html",
            f"diagnose model_tip.json FILE {DIAGNOSE}",
            "convert FILE out.csv",
            f"cut diagnose cut.toml FILE {CUT_DIAGNOSE}",
        ),
    ),
    Kind(
        "model_tip.json",
        (f"diagnose FILE steady.h5 {DIAGNOSE}", f"robot learn robot.toml FILE model_tip.json {LEARN}"),
        text=True,
    ),
    Kind("tap_x.h5", ("tap FILE tap_y.h5 tap_z.h5 --out out.h5", "inspect FILE")),
    Kind("robot.toml", ("robot frf FILE --lines 20 --out out.h5", "robot stiffness FILE --out out.json"), text=True),
    Kind("robot.toml", ("robot show FILE --out out.html", f"robot map FILE {AREA} --out out.csv"), text=True),
    Kind(
        "robot.toml",
        (f"robot deviation FILE {AREA} --out out.csv", "robot compensate FILE path.csv --out out.csv"),
        text=True,
    ),
    Kind("deflections.csv", ("robot identify robot.toml FILE --error 10 --out out.toml",), text=True),
    Kind("cut_path.csv", (f"robot path {ANGLED}",), text=True),
    Kind("learned_postures.json", ("robot frf robot.toml --pose ready --learned FILE --out out.csv",), text=True),
    Kind("campaign/campaign.toml", ("campaign campaign/campaign.toml --dry-run",), text=True, named=True),
    Kind("campaign/P1_up.h5", ("campaign campaign/campaign.toml --dry-run",), named=True),
    Kind(f"{STORED}/outcome.json", (RUN_CAMPAIGN,), text=True, named=True),
    Kind(f"{STORED}/spectra.npz", (RUN_CAMPAIGN,), named=True),
    Kind("log.mf4", ("convert FILE out.h5 --map mf4.toml",)),
    Kind("own.npy", ("convert FILE out.h5 --map npy.toml",)),
    Kind("own.npz", ("new mapping FILE --out out.toml",)),
    Kind("packed.mat", ("new mapping FILE --out out.toml",)),
    Kind("table.csv", ("new mapping FILE --out out.toml",), text=True),
    Kind("frf.csv", ("convert FILE out.h5 --map frf.toml",), text=True),
    Kind("frf.npz", ("convert FILE out.h5 --map array.toml",)),
    Kind("frf.toml", ("convert frf.csv out.h5 --map FILE",), text=True),
    Kind("points.toml", ("report model_tip.json --geometry FILE --out out.html", "convert FILE out.uff"), text=True),
    Kind("times.uff", ("convert FILE out.h5",), text=True),
    Kind("text.uff", ("convert FILE out.h5", "inspect FILE"), text=True),
)


def make_kinds(folder: Path) -> None:
    """Write the good files."""
    from millfrf.command_line import run

    _WRITING.make_inputs(folder)
    shutil.copy(next(ROBOT.rglob("staubli_rx170.toml")), folder / "robot.toml")
    for words in (
        "convert steady.h5 own.npz",
        "convert steady.h5 own.mat",
        "convert points.csv points.toml",
        f"robot learn robot.toml model_tip.json model_tip.json {LEARN.replace('out.json', 'learned_postures.json')}",
        f"lobes model_tip.json {LOBES.replace('out.csv', 'lobes.csv')}",
        "chatter steady.h5 --cutting cut.toml --speed 800 --out chatter.json",
        "fit frf_tip.h5 --band 12 60 --out fitted.json --candidates poles.json",
    ):
        named = [str(folder / word) if "." in word and word[0].isalpha() else word for word in words.split()]
        assert run(named) == 0, words
    _own_csv(folder)
    _diagnosis(folder / "diagnosis.json")
    _older(folder)
    _FOREIGN.make_foreign_files(folder)
    _campaign(folder / "campaign")


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


def _older(folder: Path) -> None:
    """Recordings of format versions 1 and 2."""
    with h5py.File(folder / "older.h5", "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "millfrf.recording", 1
        file.attrs["title"], file.attrs["setup"] = "a title", "[tool]\nteeth = 2\n"
        group = file.create_group("signals/main")
        group.attrs["sample_rate"], group.attrs["start_time"] = 100.0, 0.0
        group.attrs["channels"] = '[{"name": "fx", "quantity": "force", "unit": "N"}]'
        group["samples"] = ROWS[:, :1].astype("f4")
        file["events/speed/time"], file["events/speed/value"] = [0.5, 1.0], [6000.0, 6001.0]
    with RecordingWriter(
        folder / "second.h5",
        [
            StreamDescription(
                "main",
                100.0,
                0.0,
                (Channel("fx", "force", "N", "TCP", "+X"), Channel("ax", "acceleration", "m/s^2", "TCP", "+X")),
            )
        ],
    ) as writer:
        writer.append("main", ROWS)
        writer.append_with_missing("main", np.full((5, 2), np.nan), "a cable")
        writer.append("main", ROWS)
    with h5py.File(folder / "second.h5", "r+") as file:
        file.attrs["format_version"] = 2


def _campaign(folder: Path) -> None:
    """A campaign that has run."""
    from millfrf.command_line import run

    folder.mkdir()
    for name in ("up", "down", "central"):
        shutil.copy(folder.parent / f"{name}.h5", folder / f"P1_{name}.h5")
    (folder / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    assert run(["campaign", str(folder / "campaign.toml"), "--workers", "0"]) == 0
