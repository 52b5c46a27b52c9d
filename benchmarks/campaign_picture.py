"""The picture of the simulated campaign: poses in the work area, and the hidden drift as fits see it.

Run it: `python benchmarks/campaign_picture.py CAMPAIGN PICTURE.png`, with a folder that `millfrf demo --campaign` made.
It fits the sessions of the drifting pose and of the pose beside it in the list.
"""

import json
import re
import sys
import warnings
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import millfrf
from millfrf.robot_model import read_spatial_robot

BAND = (8.0, 95.0)


def places(truth: dict) -> np.ndarray:
    """Tool tip of each pose in the base frame, m."""
    mechanism = read_spatial_robot(truth["robot"]).robot.mechanism
    tool = mechanism.index(mechanism.tool)
    return np.array([mechanism.transforms(np.radians(each["posture_deg"]))[tool, :3, 3] for each in truth["poses"]])


def draw_area(axes: Axes, truth: dict) -> None:
    """Poses from above; the drifting one has a ring."""
    where = places(truth)
    lowest = [each["frequency_hz"][0] for each in truth["poses"]]
    shown = axes.scatter(where[:, 0], where[:, 1], c=lowest, cmap="cividis", s=70, edgecolors="0.3")
    number = [each["pose"] for each in truth["poses"]].index(truth["drift"]["pose"])
    ring = {"facecolors": "none", "edgecolors": "C3", "linewidths": 1.8}
    axes.scatter(*where[number, :2], s=260, label="softens over the sessions", **ring)
    for each, place in zip(truth["poses"], where, strict=True):
        axes.annotate(each["pose"], place[:2], (5, 6), textcoords="offset points", fontsize=7)
    axes.figure.colorbar(shown, ax=axes, label="lowest natural frequency (Hz)")
    axes.set(xlabel="x from the robot's base (m)", ylabel="y (m)", title="Poses, seen from above")
    axes.legend(loc="lower left", fontsize=8)
    axes.margins(0.12)


def fitted(folder: Path, truth: dict, pose: str, true: list[float]) -> list[tuple[int, float, float]]:
    """Session, frequency and its standard error of the mode of ``true`` that moves most, Hz."""
    broken = {each["file"] for each in truth["broken"]}
    sessions = sorted({each["session"] for each in truth["recordings"]})
    result = []
    for session in sessions:
        paths = sorted((folder / "recordings").glob(f"{pose}_*_{session}.h5"))
        sweeps = [path for path in paths if not re.search("porous", path.name)]
        if any(f"recordings/{path.name}" in broken for path in sweeps):
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model = millfrf.fit(*sweeps, band=BAND, method="subspace").model
        nearest = int(np.argmin(np.abs(model.natural_frequencies - true[session - 1])))
        errors = model.standard_errors()
        assert errors is not None
        result.append((session, float(model.natural_frequencies[nearest]), float(errors[0][nearest])))
    return result


def draw_drift(axes: Axes, folder: Path, truth: dict) -> None:
    """Frequency over sessions, as a share of the first one's truth."""
    drift = truth["drift"]
    over = np.array(drift["frequency_hz_in_each_session"])
    mode = int(np.argmin(over[-1] / over[0]))
    names = [each["pose"] for each in truth["poses"]]
    other = truth["poses"][(names.index(drift["pose"]) + 1) % len(names)]
    steady = [other["frequency_hz"][mode]] * len(over)
    for name, true, style in ((drift["pose"], over[:, mode].tolist(), "C3o"), (other["pose"], steady, "C0s")):
        rows = np.array(fitted(folder, truth, name, true))
        shares, errors = 100 * (rows[:, 1] / true[0] - 1), 200 * rows[:, 2] / true[0]
        label = f"{name}, mode {mode + 1}, fitted (2 standard errors)"
        axes.errorbar(rows[:, 0], shares, errors, fmt=style, capsize=4, label=label)
        axes.plot(np.arange(1, len(true) + 1), 100 * (np.array(true) / true[0] - 1), style[:2] + "--", linewidth=1)
    axes.set(
        xlabel="session", ylabel="change of frequency (%)", title="The hidden drift (dashed: truth at 22 degrees C)"
    )
    axes.set_xticks(range(1, len(over) + 1))
    axes.legend(fontsize=8)
    axes.grid(True, color="0.9")


def main(folder: str, picture: str) -> None:
    """Draw both panels."""
    truth = json.loads((Path(folder) / "concealed.json").read_text(encoding="utf-8"))
    figure = Figure(figsize=(10.5, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_area(left, truth)
    draw_drift(right, Path(folder), truth)
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(*sys.argv[1:])
