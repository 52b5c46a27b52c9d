"""The chain of a shop on the public command line, from recordings and taps to a report, with what each step says."""

import contextlib
import csv
import html
import io
import re
import time
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from millfrf.command_line import run

from .robot_cell import Cell

SPEEDS = 24  # spindle speeds of the lobes
TOP = 48.0  # Hz; the shop trusts the sweeps up to here

CHAIN = (
    "estimate {cuts} --out {d}/frf.h5",
    "fit {cuts} --band {band} --out {d}/housing.json",
    "tap {hits} --response tip_x,tip_y,tip_z --out {d}/tip.h5",
    "tap {hits} --response housing_x,housing_y,housing_z --out {d}/sensor.h5",
    "calibrate {d}/housing.json --tip {d}/tip.h5 --sensor {d}/sensor.h5 --out {d}/tip.json",
    "lobes {d}/tip.json --cutting {d}/cut.toml --speeds {speeds} --max-depth {depth} --out {d}/lobes.csv",
    "report {d}/housing.json {d}/tip.json {d}/lobes.csv {d}/cut.toml --out {d}/report.html",
)
"""What a shop types, as in the tutorial of docs/tutorials/mat_to_cut.md, without an option that could be left out."""

ADVICE = re.compile(r"largest removal rate at .*? confidence of stability.*?: ([\d.e+-]+) mm at ([\d.]+) rpm")
NO_ADVICE = re.compile(
    r"((?:No recommended cut|No band and no recommended cut|The recommended cut is withdrawn).*?)(?=<)", re.S
)


@dataclass
class Outcome:
    """What the chain gave.

    Parameters
    ----------
    advice
        Recommended speed (rpm) and depth (m); None: none.
    reason
        Why there is no advice, in the chain's words; empty if nothing was said.
    limits
        Speed (rpm), depth limit (m), chatter frequency (Hz), bifurcation and status, a row of the lobes each.
    said
        Standard output and error of each step, by its name.
    failed
        Step that ended with an exit code other than 0, with its message; empty: none.
    seconds
        Processor time of each step.
    """

    advice: tuple[float, float] | None = None
    reason: str = ""
    limits: list[tuple[float, float, float, str, str]] = field(default_factory=list)
    said: dict[str, str] = field(default_factory=dict)
    failed: str = ""
    seconds: dict[str, float] = field(default_factory=dict)

    def step(self, *words: str) -> bool:
        """Run a command; return whether it ended well."""
        heard, began = io.StringIO(), time.process_time()
        with contextlib.redirect_stdout(heard), contextlib.redirect_stderr(heard):
            code = run([*words, "--force"])
        name = words[0] if words[0] not in self.said else f"{words[0]} again"
        self.said[name], self.seconds[name] = heard.getvalue(), time.process_time() - began
        if code:
            self.failed = f"{name}, exit code {code}: {heard.getvalue().strip()[-400:]}"
        return code == 0


def run_chain(cell: Cell, folder: Path) -> Outcome:
    """Run the chain in a folder that ``write_cell`` has filled; its path has no spaces."""
    outcome = Outcome()
    cuts, hits = (" ".join(map(str, sorted(folder.glob(f"{kind}_*.h5")))) for kind in ("cut", "hit"))
    speeds = f"{cell.speeds_rpm[0]:g} {cell.speeds_rpm[1]:g} {SPEEDS}"
    for command in CHAIN:
        band = _band(folder / "frf.h5") if "{band}" in command else ""
        words = command.format(d=folder, cuts=cuts, hits=hits, band=band, speeds=speeds, depth=f"{cell.max_depth:.6g}")
        if not outcome.step(*words.split()):
            return outcome
        if words.startswith("lobes"):
            outcome.limits = _limits(folder / "lobes.csv")
    outcome.advice, outcome.reason = advice_of((folder / "report.html").read_text(encoding="utf-8"))
    return outcome


def _band(frf: Path) -> str:
    """Band of the fit: that in which the FRF holds, up to TOP."""
    with h5py.File(frf) as file:
        low, high = (float(value) for value in np.asarray(file.attrs["band_hz"]))
    return f"{low:.4g} {min(high, TOP):.4g}"


def _limits(path: Path) -> list[tuple[float, float, float, str, str]]:
    rows = csv.DictReader(path.read_text(encoding="utf-8").splitlines())
    return [
        (
            float(row["spindle_speed_rpm"]),
            float(row["depth_limit_m"]),
            float(row["chatter_frequency_hz"] or "nan"),
            row["bifurcation"],
            row["status"],
        )
        for row in rows
    ]


def advice_of(page: str) -> tuple[tuple[float, float] | None, str]:
    """Recommended speed (rpm) and depth (m) of a report, or None with the reason."""
    text = html.unescape(page)
    match = ADVICE.search(text)
    if match:
        return (float(match[2]), 1e-3 * float(match[1])), ""
    without = NO_ADVICE.search(text)
    return None, " ".join(without[1].split()) if without else ""
