"""The chain of a shop on the public command line: recordings and taps to lobes and a report, with what each step says."""

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
    """Run the chain in a folder that ``write_cell`` has filled."""
    outcome = Outcome()
    files = {
        key: str(folder / key)
        for key in ("frf.h5", "housing.json", "tip.h5", "sensor.h5", "tip.json", "lobes.csv", "cut.toml", "report.html")
    }
    cuts = [str(path) for path in sorted(folder.glob("cut_*.h5"))]
    hits = [str(path) for path in sorted(folder.glob("hit_*.h5"))]
    low, high = cell.speeds_rpm
    ready = (
        outcome.step("estimate", *cuts, "--out", files["frf.h5"])
        and outcome.step("fit", *cuts, "--band", *_band(folder / "frf.h5"), "--out", files["housing.json"])
        and outcome.step("tap", *hits, "--response", "tip_x,tip_y,tip_z", "--out", files["tip.h5"])
        and outcome.step("tap", *hits, "--response", "housing_x,housing_y,housing_z", "--out", files["sensor.h5"])
        and outcome.step(
            "calibrate",
            files["housing.json"],
            "--tip",
            files["tip.h5"],
            "--sensor",
            files["sensor.h5"],
            "--out",
            files["tip.json"],
        )
        and outcome.step(
            "lobes",
            files["tip.json"],
            "--cutting",
            files["cut.toml"],
            "--speeds",
            f"{low:g}",
            f"{high:g}",
            str(SPEEDS),
            "--max-depth",
            f"{cell.max_depth:.6g}",
            "--out",
            files["lobes.csv"],
        )
    )
    if ready:
        outcome.limits = _limits(folder / "lobes.csv")
        named = ("housing.json", "tip.json", "lobes.csv", "cut.toml")
        if outcome.step("report", *(files[key] for key in named), "--out", files["report.html"]):
            outcome.advice, outcome.reason = advice_of((folder / "report.html").read_text(encoding="utf-8"))
    return outcome


def _band(frf: Path) -> tuple[str, str]:
    """Band of the fit: that in which the FRF holds, up to TOP."""
    with h5py.File(frf) as file:
        low, high = (float(value) for value in np.asarray(file.attrs["band_hz"]))
    return f"{low:.4g}", f"{min(high, TOP):.4g}"


def _limits(path: Path) -> list[tuple[float, float, float, str, str]]:
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    rows = csv.DictReader(lines)
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
    found = ADVICE.search(text)
    if found:
        return (float(found[2]), 1e-3 * float(found[1])), ""
    without = NO_ADVICE.search(text)
    return None, " ".join(without[1].split()) if without else ""
