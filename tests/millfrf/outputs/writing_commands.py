"""Every command that writes files, with small inputs: one table for the trials of kills, full disks and provenance."""

import importlib.util
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition import Channel, RecordingWriter, StreamDescription

_SPEC = importlib.util.spec_from_file_location(
    "good_files_of_outputs", Path(__file__).parents[1] / "mistakes" / "good_files.py"
)
assert _SPEC is not None
assert _SPEC.loader is not None
good_files = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(good_files)


@dataclass(frozen=True)
class Writing:
    """A command line, run in a folder with the inputs, and what it writes there."""

    name: str
    arguments: str
    outputs: tuple[str, ...]

    @property
    def words(self) -> list[str]:
        """The command line in words."""
        return self.arguments.split()


ROBOT = "staubli_rx170 --pose ready"
LOBES = "--cutting cut.toml --speeds 600 1200 4 --max-depth 0.01 --method zero-order"
DEFLECTIONS = """joint_1_deg,joint_2_deg,joint_3_deg,joint_4_deg,joint_5_deg,joint_6_deg,fx_n,fy_n,fz_n,dx_m,dy_m,dz_m
0,-20,110,0,90,0,100,0,0,8e-4,0,1e-4
30,-30,100,20,60,10,0,100,-200,1e-4,9e-4,-6e-4
-40,0,90,-60,80,40,50,-80,-300,3e-4,-5e-4,-9e-4
"""
COMMANDS = (
    Writing("recover", "recover killed.h5 --out out.h5", ("out.h5",)),
    Writing("convert npz", "convert up.h5 out.npz", ("out.npz",)),
    Writing("convert mat", "convert up.h5 out.mat", ("out.mat",)),
    Writing("convert csv", "convert up.h5 out.csv", ("out.csv",)),
    Writing("convert h5", "convert table.csv out.h5 --map map.toml", ("out.h5",)),
    Writing("convert can", "convert log.asc out.h5 --map log.toml", ("out.h5",)),
    Writing("convert uff", "convert frf_tip.h5 out.uff", ("out.uff",)),
    Writing("convert frf", "convert given.uff out.h5", ("out.h5",)),
    Writing("convert modes", "convert model_tip.json out.unv", ("out.unv",)),
    Writing("convert model", "convert given.unv out.json", ("out.json",)),
    Writing("convert geometry", "convert points.csv out.toml", ("out.toml",)),
    Writing("estimate", "estimate up.h5 down.h5 central.h5 --segment 4 --out out.h5", ("out.h5",)),
    Writing("tap", "tap tap_x.h5 tap_y.h5 tap_z.h5 --out out.h5", ("out.h5",)),
    Writing("tool", "tool blank.toml --new new.toml --out out.h5 --picture out.png", ("out.h5", "out.png")),
    Writing("fit", "fit frf_tip.h5 --band 12 60 --out out.json --candidates poles.json", ("out.json", "poles.json")),
    Writing("fit records", "fit up.h5 down.h5 central.h5 --band 13 30 --out out.json", ("out.json",)),
    Writing(
        "calibrate",
        "calibrate model_process.json --tip frf_tip.h5 --sensor frf_housing.h5 --out out.json",
        ("out.json",),
    ),
    Writing("lobes", f"lobes model_tip.json {LOBES} --out out.csv", ("out.csv",)),
    Writing("chatter", "chatter steady.h5 --cutting cut.toml --speed 800 --out out.json", ("out.json",)),
    Writing(
        "learn",
        "learn model_tip.json made.csv --cutting cut_errors.toml --speeds 600 900 3 --max-depth 0.01 --out out",
        tuple(
            f"out/{name}"
            for name in ("learned.json", "evidence.csv", "limits.csv", "lobes.png", "model.json", "cut.toml")
        ),
    ),
    Writing("predict", "predict model_tip.json steady.h5 --out out.h5", ("out.h5",)),
    Writing(
        "diagnose",
        "diagnose model_tip.json steady.h5 --out out",
        ("out/diagnosis.json", "out/improved_model.json", "out/report.html"),
    ),
    Writing("cut identify", "cut identify cut.toml up.h5 --depth 0.001 --feeds 150e-6 --out out.toml", ("out.toml",)),
    Writing(
        "cut diagnose",
        "cut diagnose cut.toml steady.h5 --depth 0.001 --out out",
        ("out/diagnosis.json", "out/improved_cut.toml", "out/report.html"),
    ),
    Writing(
        "cut simulate",
        "cut simulate model_tip.json --cutting cut.toml --speed 800 --depth 0.001 --revolutions 8 --out out.h5",
        ("out.h5",),
    ),
    Writing(
        "cut wall",
        "cut wall model_tip.json --cutting cut.toml --speeds 800 900 3 --depth 0.001 --out out.csv",
        ("out.csv",),
    ),
    Writing("report", "report frf_tip.h5 model_tip.json --out out.html", ("out.html",)),
    Writing("robot modes", f"robot modes {ROBOT} --picture out.html", ("out.html",)),
    Writing("robot frf", f"robot frf {ROBOT} --lines 50 --out out.h5", ("out.h5",)),
    Writing("robot model", f"robot frf {ROBOT} --out out.json", ("out.json",)),
    Writing("robot stiffness", f"robot stiffness {ROBOT} --out out.json", ("out.json",)),
    Writing(
        "robot deviation",
        "robot deviation staubli_rx170 --x 1 1.1 2 --y 0 0.1 2 --out out.csv --picture out.png",
        ("out.csv", "out.png"),
    ),
    Writing("robot lobes", f"robot lobes {ROBOT} {LOBES} --out out.csv", ("out.csv",)),
    Writing("robot map", "robot map staubli_rx170 --picture out.png --x 1 1.1 2 --y 0 0.1 2", ("out.png",)),
    Writing("robot map table", "robot map staubli_rx170 --out out.csv --x 1 1.1 2 --y 0 0.1 2", ("out.csv",)),
    Writing(
        "robot path",
        "robot path kuka_kr90_angled cut_path.csv --cutting cut.toml --speed 3000 --depth 0.001 "
        "--turns -9 0 2 --out out",
        ("out/path.csv", "out/path.png", "out/compensated.csv"),
    ),
    Writing(
        "robot advice",
        "robot advice kuka_kr90_r3100 cut_path.csv --learned learned.json --cutting cut.toml --speeds 3000 3000 1 "
        "--max-depth 0.01 --segments 1 --speed-error 0 --out out.csv --picture out.png",
        ("out.csv", "out.png"),
    ),
    Writing("robot compensate", "robot compensate staubli_rx170 path.csv --out out.csv", ("out.csv",)),
    Writing(
        "robot identify",
        "robot identify staubli_rx170 deflections.csv --error 10 --out out.toml",
        ("out.toml",),
    ),
)


def make_inputs(folder: Path) -> None:
    """Write the files that the commands read."""
    from millfrf.command_line import run

    good_files.make(folder)
    (folder / "cut_errors.toml").write_text(good_files.CUT + "ktc_std_pa = 2e7\n", encoding="utf-8")
    (folder / "made.csv").write_text("spindle_speed_rpm,depth_m,verdict\n800,0.001,stable\n", encoding="utf-8")
    _killed(folder / "killed.h5")
    _can_log(folder)
    _blank(folder)
    _learned_postures(folder / "learned.json")
    (folder / "deflections.csv").write_text(DEFLECTIONS, encoding="utf-8")
    (folder / "cut_path.csv").write_text("x_m,y_m,z_m,i,j,k\n1.5,0.1,0.7,0,0,1\n1.6,0.1,0.7,0,0,1\n", encoding="utf-8")
    (folder / "points.csv").write_text("point,x [m],y [m],z [m]\n1,0,0,0\n2,0.1,0,0\n", encoding="utf-8")
    for source, target in (("frf_tip.h5", "given.uff"), ("model_tip.json", "given.unv")):
        assert run(["convert", str(folder / source), str(folder / target)]) == 0


def _killed(path: Path) -> None:
    """A recording as a killed writer leaves it."""
    channels = (Channel("fx", "force", "N", "TCP", "+X"), Channel("ax", "acceleration", "m/s^2", "TCP", "+X"))
    whole = path.with_name("whole.h5")
    with RecordingWriter(whole, [StreamDescription("main", 100.0, 0.0, channels)], block_length=64) as writer:
        writer.append("main", np.random.default_rng(0).standard_normal((20_000, 2)))
        path.write_bytes(whole.read_bytes())
    whole.unlink()


def _blank(folder: Path) -> None:
    """A blank with an FRF at two points, and a tool that is the same."""
    from estimation import write_frf
    from modal_fit import ModalModel

    natural, points = 2 * np.pi * np.array([420.0, 900.0, 1900.0]), ("TCP:+X", "MID:+X")
    shapes = np.array([[0.5, 0.3], [0.9, 0.2], [1.2, -0.4]]) / np.sqrt(2j * natural)[:, None]
    frf = ModalModel(-0.02 * natural + 1j * natural, shapes, shapes, points, points).frf(np.arange(100.0, 2400.0, 10.0))
    write_frf(folder / "blank_frf.h5", frf)
    tool = (
        "[distance_from_tip_m]\nTCP = 0.0\nMID = 0.04\n\n[material.carbide]\nyoungs_modulus_pa = 580e9\n"
        'density_kg_per_m3 = 14500\n\n[[segment]]\nmaterial = "carbide"\nlength_m = 0.07\ndiameter_m = 0.012\n'
    )
    (folder / "blank.toml").write_text(f'frf = "blank_frf.h5"\n{tool}', encoding="utf-8")
    (folder / "new.toml").write_text(tool, encoding="utf-8")


def _learned_postures(path: Path) -> None:
    """What two postures of a robot as it is modelled would teach."""
    from millfrf.robot_model import (
        learn_postures,
        measured_modes,
        modal_model_at,
        read_spatial_robot,
        write_learned_postures,
    )

    robot = read_spatial_robot("kuka_kr90_r3100").robot
    postures = np.radians([[0, -10, 100, 0, 90, 0], [20, 25, 70, 40, 60, 0]])
    models = [modal_model_at(robot, q, highest_frequency=45.0) for q in postures]
    measured = [measured_modes(f"{k}", q, model) for k, (q, model) in enumerate(zip(postures, models, strict=True), 1)]
    write_learned_postures(path, learn_postures(robot, measured))


def _can_log(folder: Path) -> None:
    import can

    (folder / "cell.dbc").write_text(
        'VERSION ""\nBU_: PLC\nBO_ 256 Spindle: 8 PLC\n SG_ Speed : 0|16@1+ (1,0) [0|1] "" PLC\n', encoding="utf-8"
    )
    (folder / "log.toml").write_text(
        'recording = "up.h5"\ndbc = "cell.dbc"\nsignals = [{signal = "Speed"}]\n', encoding="utf-8"
    )
    with can.Logger(folder / "log.asc") as writer:
        for k in range(30):
            writer(can.Message(1.7e9 + 0.1 * k, 256, is_extended_id=False, data=bytes([k] * 8), channel=0))


def table_as_json() -> str:
    """The table for a program in another process."""
    return json.dumps([[each.name, each.words] for each in COMMANDS])
