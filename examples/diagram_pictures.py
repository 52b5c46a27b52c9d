"""Diagrams of the pages: `python examples/diagram_pictures.py [FOLDER]`, by default into `docs/pictures`.

`diagram_files.png`: which command makes which file of which; `diagram_rig.png`: which device is wired to what;
`diagram_frame.png`: the milling frame, the immersion angle and the force on the tool; `diagram_layers.png`: the rooms
of the code in their layers, as import-linter checks them.
"""

import sys
import tomllib
from math import cos, pi, sin
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, FancyBboxPatch

FILES = {
    "other": (0, 3, "MAT CSV TDMS\nUFF WAV NPZ"),
    "devices": (0, 1.5, "devices"),
    "recording": (3.8, 2.25, "recording\n.h5"),
    "frf": (7.6, 3, "FRF\n.h5  .uff"),
    "model": (11.4, 2.25, "modal model\n.json"),
    "lobes": (15.2, 3, "lobes\n.csv"),
    "diagnosis": (15.2, 1.5, "diagnosis\n.json"),
}
STEPS = (
    ("other", "recording", "convert"),
    ("devices", "recording", "acquire"),
    ("recording", "frf", "estimate, tap"),
    ("recording", "model", "fit"),
    ("frf", "model", "fit"),
    ("model", "lobes", "lobes"),
    ("model", "diagnosis", "diagnose"),
)
RIG = {
    "tool": (0, 3.2, "force plate or\nspindle dynamometer"),
    "spindle": (0, 2.0, "IEPE accelerometers\non the housing"),
    "speed": (0, 0.8, "encoder, tachometer"),
    "robot": (0, -0.4, "robot, spindle drive"),
    "amplifier": (3.6, 3.2, "charge amplifier"),
    "ni": (7.2, 2.0, "NI modules\n[device], [[channels]]"),
    "bus": (7.2, -0.4, "[[can]] [[modbus]]\n[[rsi]]"),
    "pc": (10.8, 1.2, "millfrf\nacquire"),
}
CABLES = (
    ("tool", "amplifier", "charge"),
    ("amplifier", "ni", "±10 V"),
    ("spindle", "ni", "current 2 mA"),
    ("speed", "ni", "pulses"),
    ("robot", "bus", "bus or network"),
    ("ni", "pc", "USB"),
    ("bus", "pc", ""),
)


def boxes(
    places: dict[str, tuple[float, float, str]], arrows: tuple[tuple[str, str, str], ...], size: tuple[float, float]
) -> Figure:
    """Boxes with words, and arrows between them with words."""
    figure, axes = plt.subplots(figsize=size, layout="constrained")
    half = 1.2 if places is FILES else 1.35
    for x, y, words in places.values():
        frame = FancyBboxPatch((x - half, y - 0.4), 2 * half, 0.8, boxstyle="round,pad=0.05", facecolor="0.95")
        axes.add_patch(frame)
        axes.text(x, y, words, ha="center", va="center", fontsize=9)
    for start, end, words in arrows:
        (x0, y0, _), (x1, y1, _) = places[start], places[end]
        begin, stop = (x0 + half + 0.07, y0), (x1 - half - 0.07, y1)
        axes.annotate("", stop, begin, arrowprops={"arrowstyle": "-|>", "color": "0.2"})
        middle = ((begin[0] + stop[0]) / 2, (begin[1] + stop[1]) / 2 + 0.02)
        axes.text(
            *middle,
            words,
            ha="center",
            va="bottom",
            fontsize=8,
            style="italic",
            bbox={"facecolor": "1.0", "edgecolor": "none", "pad": 1},
        )
    axes.set(xlim=(-1.5, max(x for x, _, _ in places.values()) + 1.5))
    heights = [y for _, y, _ in places.values()]
    axes.set(ylim=(min(heights) - 0.6, max(heights) + 0.6))
    axes.axis("off")
    return figure


def arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], words: str, shade: str = "0.0") -> None:
    """An arrow with a word at its tip."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": shade, "linewidth": 1.5})
    away = (1.12 * end[0] - 0.12 * start[0], 1.12 * end[1] - 0.12 * start[1])
    axes.text(*away, words, ha="center", va="center", fontsize=10, color=shade)


def frame() -> Figure:
    """The tool from above: X the feed of the tool, phi from +Y in the direction of rotation."""
    figure, axes = plt.subplots(figsize=(4.6, 4.2), layout="constrained")
    axes.add_patch(plt.Circle((0, 0), 1, fill=False, color="0.4"))
    arrow(axes, (0, 0), (1.6, 0), "X, feed")
    arrow(axes, (0, 0), (0, 1.5), "Y")
    phi = 50 * pi / 180
    tooth = (sin(phi), cos(phi))
    axes.plot([0, tooth[0]], [0, tooth[1]], color="0.2", linewidth=1.5)
    axes.add_patch(Arc((0, 0), 1, 1, theta1=40, theta2=90, color="0.2"))
    axes.text(0.27, 0.55, "φ", fontsize=12)
    arrow(axes, tooth, (tooth[0] - 0.55 * cos(phi), tooth[1] + 0.55 * sin(phi)), "$F_t$", "0.35")
    arrow(axes, tooth, (tooth[0] - 0.35 * sin(phi), tooth[1] - 0.35 * cos(phi)), "$F_r$", "0.35")
    axes.add_patch(Arc((0, 0), 2.5, 2.5, theta1=200, theta2=250, color="0.4"))
    start, end = ((1.25 * cos(a * pi / 180), 1.25 * sin(a * pi / 180)) for a in (203, 200))
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": "0.4"})
    axes.text(-1.05, -1.05, "rotation", fontsize=9, color="0.3", ha="center")
    axes.set(xlim=(-1.6, 2.0), ylim=(-1.4, 1.8), aspect="equal")
    axes.axis("off")
    return figure


def layers() -> Figure:
    """Draw the rooms in the layers of `pyproject.toml`: a room imports from the layers below it alone."""
    settings = tomllib.loads((Path(__file__).resolve().parents[1] / "pyproject.toml").read_text(encoding="utf-8"))
    contract = settings["tool"]["importlinter"]["contracts"][0]
    rows = [[room.strip().removeprefix("millfrf.") for room in row.split("|")] for row in reversed(contract["layers"])]
    figure, axes = plt.subplots(figsize=(7.5, 0.42 * len(rows)), layout="constrained")
    for height, rooms in enumerate(rows):
        width = 6 / len(rooms)
        for number, room in enumerate(rooms):
            box = (number * width + 0.05, height + 0.12)
            shade = "0.85" if room in ("acquisition", "estimation", "modal_fit", "replay_data") else "0.95"
            axes.add_patch(FancyBboxPatch(box, width - 0.1, 0.7, boxstyle="round,pad=0.02", facecolor=shade))
            axes.text(box[0] + width / 2 - 0.05, height + 0.47, room, ha="center", va="center", fontsize=9)
    axes.annotate("", (6.35, 0.2), (6.35, len(rows) - 0.2), arrowprops={"arrowstyle": "-|>", "color": "0.2"})
    axes.text(6.5, len(rows) / 2, "imports", rotation=-90, va="center", fontsize=9, style="italic")
    axes.set(xlim=(0, 6.8), ylim=(0, len(rows)))
    axes.axis("off")
    return figure


def main(folder: Path) -> None:
    """Draw all of them."""
    pictures = {
        "files": boxes(FILES, STEPS, (11, 2.4)),
        "rig": boxes(RIG, CABLES, (9.5, 3.6)),
        "frame": frame(),
        "layers": layers(),
    }
    for name, figure in pictures.items():
        figure.savefig(folder / f"diagram_{name}.png", dpi=130)
        print(folder / f"diagram_{name}.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[1] / "docs" / "pictures")
