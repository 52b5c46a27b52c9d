"""Another tool in a spindle: taps on two blanks, its tip without a measurement, and lobes beside the truth.

Run it: `python examples/another_tool.py [PICTURE.png]`. The spindle is a chain of Timoshenko elements on two bearings,
which shares no code with `millfrf tool`; two blanks are tapped at two points in X and Y, with noise.
"""

import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from acquisition import Channel, RecordingWriter, StreamDescription
from estimation import Frf
from millfrf.cutting import MillingProcess
from millfrf.stability import StabilityLobes, certified_lobes, limit_band
from millfrf.steps.fit import fit
from millfrf.steps.tap import tap
from millfrf.steps.tool import ToolTip, tool

STEEL = {"youngs_modulus_pa": 205e9, "density_kg_per_m3": 7850.0, "poissons_ratio": 0.29, "loss_factor": 0.002}
CARBIDE = {"youngs_modulus_pa": 585e9, "density_kg_per_m3": 14400.0, "poissons_ratio": 0.22, "loss_factor": 0.0015}


@dataclass(frozen=True)
class Cylinder:
    """A cylinder with its material; ``share`` of the diameter is left by flutes."""

    length: float
    diameter: float
    material: Mapping[str, float] = field(default_factory=lambda: CARBIDE)
    share: float = 1.0

    @property
    def outer(self) -> float:
        """The diameter that bends."""
        return self.share * self.diameter


def element(cylinder: Cylinder, length: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Stiffness and consistent mass of an element over ``(w, theta)`` of both ends (Friedman & Kosmatka 1993)."""
    e, rho, nu = (cylinder.material[name] for name in ("youngs_modulus_pa", "density_kg_per_m3", "poissons_ratio"))
    area, moment = np.pi / 4 * cylinder.outer**2, np.pi / 64 * cylinder.outer**4
    shear = 6 * (1 + nu) / (7 + 6 * nu) * e / (2 * (1 + nu)) * area
    p, x = 12 * e * moment / (shear * length**2), length
    stiffness = np.array(
        [
            [12, 6 * x, -12, 6 * x],
            [6 * x, (4 + p) * x**2, -6 * x, (2 - p) * x**2],
            [-12, -6 * x, 12, -6 * x],
            [6 * x, (2 - p) * x**2, -6 * x, (4 + p) * x**2],
        ]
    ) * (e * moment / ((1 + p) * x**3))
    a = 70 * p**2 + 147 * p + 78
    b = (35 * p**2 + 77 * p + 44) * x / 4
    c = 35 * p**2 + 63 * p + 27
    d = -(35 * p**2 + 63 * p + 26) * x / 4
    g = (7 * p**2 + 14 * p + 8) * x**2 / 4
    h = -(7 * p**2 + 14 * p + 6) * x**2 / 4
    moved = np.array([[a, b, c, d], [b, g, -d, h], [c, -d, a, -b], [d, h, -b, g]]) * (
        rho * area * x / (210 * (1 + p) ** 2)
    )
    q = -(15 * p - 3) * x
    r = (10 * p**2 + 5 * p + 4) * x**2
    s = (5 * p**2 - 5 * p - 1) * x**2
    turned = np.array([[36, q, -36, q], [q, r, -q, s], [-36, -q, 36, -q], [q, s, -q, r]]) * (
        rho * moment / (30 * (1 + p) ** 2 * x)
    )
    return stiffness * (1 + 1j * cylinder.material["loss_factor"]), moved + turned


@dataclass(frozen=True)
class Spindle:
    """A shaft on two bearings with a holder; the tool is joined to its nose rigidly or by springs."""

    shaft: tuple[Cylinder, ...]
    bearings: tuple[tuple[float, float, float], ...]  # place (m), stiffness (N/m), damping (N s/m)
    contact: tuple[complex, complex] | None = None  # N/m and N m/rad, complex with loss

    def receptance(
        self, tool: Sequence[Cylinder], distances: Sequence[float], frequencies: NDArray[Any], size: float = 2.5e-3
    ) -> NDArray[Any]:
        """Receptance (n, m, m) between points of the tool (or holder) at distances from the tip."""
        parts = [(cylinder, 0) for cylinder in self.shaft] + [(cylinder, 1) for cylinder in tool]
        nodes, elements, owner = [0.0], [], [0]
        nose = sum(cylinder.length for cylinder in self.shaft)
        total = nose + sum(cylinder.length for cylinder in tool)
        marks = [total - distance for distance in distances] + [place for place, _, _ in self.bearings]
        start = 0.0
        for cylinder, side in parts:
            if side and not owner[-1] and self.contact is not None:
                nodes.append(start)
                owner.append(1)
            inner = [mark for mark in marks if start + 1e-9 < mark < start + cylinder.length - 1e-9]
            edges = [start, *sorted(inner), start + cylinder.length]
            for a, b in pairwise(edges):
                count = max(1, int(np.ceil((b - a) / size)))
                for k in range(count):
                    elements.append((len(nodes) - 1, cylinder, (b - a) / count))
                    nodes.append(a + (b - a) * (k + 1) / count)
                    owner.append(side)
            start += cylinder.length
        n = 2 * len(nodes)
        stiffness, mass, damping = np.zeros((n, n), complex), np.zeros((n, n)), np.zeros((n, n))
        for first, cylinder, length in elements:
            springs, masses = element(cylinder, length)
            both = slice(2 * first, 2 * first + 4)
            stiffness[both, both] += springs
            mass[both, both] += masses
        places = np.array(nodes)
        for place, spring_rate, damper in self.bearings:
            node = 2 * int(np.argmin(np.abs(places - place)))
            stiffness[node, node] += spring_rate
            damping[node, node] += damper
        if self.contact is not None:
            first = 2 * owner.index(1) - 2
            for dof, spring in enumerate(self.contact):
                pair = np.ix_([first + dof, first + 2 + dof], [first + dof, first + 2 + dof])
                stiffness[pair] += spring * np.array([[1, -1], [-1, 1]])
        points = [2 * int(np.argmin(np.abs(places - (total - distance)))) for distance in distances]
        load = np.zeros((n, len(points)))
        load[points, np.arange(len(points))] = 1.0
        out = np.empty((len(frequencies), len(points), len(points)), complex)
        stiffness, damping, mass = (banded(matrix) for matrix in (stiffness, damping, mass))
        for number, w in enumerate(2 * np.pi * frequencies):
            dynamic = stiffness + 1j * w * damping - w**2 * mass
            out[number] = scipy.linalg.solve_banded((3, 3), dynamic, load, check_finite=False)[points]
        return out


def banded(matrix: NDArray[Any]) -> NDArray[Any]:
    """Seven diagonals of a matrix, as solve_banded takes them."""
    n = len(matrix)
    rows = np.zeros((7, n), dtype=matrix.dtype)
    for offset in range(-3, 4):
        diagonal = np.diagonal(matrix, offset)
        rows[3 - offset, max(offset, 0) : max(offset, 0) + len(diagonal)] = diagonal
    return rows


def spindle_in(direction: str, contact: tuple[complex, complex] | None = None) -> Spindle:
    """A high-speed spindle, a little different in X and Y."""
    stiffer = 1.0 if direction == "X" else 1.18
    shaft = (
        Cylinder(0.10, 0.050, STEEL),
        Cylinder(0.16, 0.060, STEEL),
        Cylinder(0.06, 0.055, STEEL),
        Cylinder(0.07, 0.036, STEEL),
    )
    bearings = ((0.04, 0.9e8 * stiffer, 700.0), (0.22, 1.5e8 * stiffer, 1500.0))
    return Spindle(shaft, bearings, contact)


BLANKS = {"long": (Cylinder(0.095, 0.012),), "short": (Cylinder(0.060, 0.012),)}
ENDMILL = (Cylinder(0.030, 0.012), Cylinder(0.045, 0.012, share=0.8))
POINTS = {"TCP": 0.0, "MID": 0.035}  # m from the tip
RATE, PERIOD, TAPS, CONTACT, NOISE = 20480.0, 0.4, 5, 0.065e-3, 0.3  # Hz, s, number, s, m/s^2
BAND, SPEEDS, DEEPEST = (150.0, 3500.0), (6000.0, 24000.0, 60), 0.003
CUT = MillingProcess(2, 0.012, np.pi / 2, 1.2e9, 0.25, 0.0, np.pi / 2, np.pi, 0.1e-3)


def tool_text(tool_: Sequence[Cylinder], frf: str = "") -> str:
    """Tool file of cylinders; that of a blank names its FRF and places its points."""
    lines = [f'frf = "{frf}"', "", "[distance_from_tip_m]", *(f"{n} = {x}" for n, x in POINTS.items())] if frf else []
    lines += ["", "[material.carbide]", *(f"{name} = {value}" for name, value in CARBIDE.items())]
    for cylinder in tool_:
        lines += ["", "[[segment]]", 'material = "carbide"']
        lines += [f"length_m = {cylinder.length}", f"diameter_m = {cylinder.diameter}"]
        lines += ["fluted = true"] if cylinder.share < 1 else []
    return "\n".join(lines) + "\n"


def write_taps(folder: Path, seed: int = 0) -> None:
    """Write tool files and recordings ``long_x_tcp.h5`` ... of taps on the blanks at both points."""
    rng = np.random.default_rng(seed)
    lines = np.fft.rfftfreq(round(RATE * PERIOD), 1 / RATE)
    for name, blank in BLANKS.items():
        (folder / f"{name}.toml").write_text(tool_text(blank, f"{name}.h5"), encoding="utf-8")
        for direction in "XY":
            motion = np.zeros((len(lines), 2, 2), dtype=complex)
            motion[1:] = spindle_in(direction).receptance(blank, list(POINTS.values()), lines[1:])
            motion *= -((2 * np.pi * lines) ** 2)[:, None, None]
            for number, point in enumerate(POINTS):
                path = folder / f"{name}_{direction}_{point}.h5".lower()
                _record(path, direction, point, motion[:, :, number], rng)
    (folder / "endmill.toml").write_text(tool_text(ENDMILL), encoding="utf-8")


def _record(path: Path, direction: str, point: str, motion: NDArray[Any], rng: np.random.Generator) -> None:
    """Record taps at one point, with accelerometers at both: pulses of force, and the answer of a whole period."""
    size = round(RATE * PERIOD)
    time = np.arange(size) / RATE - 0.1 * PERIOD
    channels = (
        Channel("hammer", "force", "N", point, f"+{direction}"),
        *(Channel(f"a_{node}".lower(), "acceleration", "m/s^2", node, f"+{direction}") for node in POINTS),
    )
    with RecordingWriter(path, [StreamDescription("main", RATE, 0.0, channels)]) as writer:
        for peak in rng.uniform(120, 250, TAPS):
            force = peak * np.exp(-((time / CONTACT) ** 2) / 2)  # drives next to nothing at half the sample rate
            answer = np.fft.irfft(motion * np.fft.rfft(force)[:, None], size, axis=0)
            noise = rng.standard_normal((size, 3)) * [0.02, NOISE, NOISE]
            writer.append("main", np.column_stack([force, answer]) + noise)


def true_tip(frequencies: NDArray[Any]) -> Frf:
    """The FRF at the tip of the end mill in the spindle."""
    tips = [spindle_in(direction).receptance(ENDMILL, [0.0], frequencies)[:, 0, 0] for direction in "XY"]
    places, own = ("TCP:+X", "TCP:+Y"), np.eye(2)
    values = np.asarray(np.stack(tips, axis=1)[:, :, None] * own, dtype=complex)
    valid = np.ones(len(frequencies), dtype=bool)
    band = (float(frequencies[0]), float(frequencies[-1]))
    return Frf(frequencies, values, places, places, "receptance", "m/N", valid, band=band, measured=own.astype(bool))


def predicted(folder: Path) -> ToolTip:
    """Tap FRFs of both blanks, and the tip of the end mill from them."""
    for name in BLANKS:
        tap(*sorted(folder.glob(f"{name}_*.h5")), out=folder / f"{name}.h5", segment=0.35, exponential="none")
    return tool(*(folder / f"{name}.toml" for name in BLANKS), new=folder / "endmill.toml", out=folder / "tip.h5")


def draw_frf(axes: Axes, tip: ToolTip, true: Frf) -> None:
    """Draw the prediction with its band, and the truth, in X."""
    frf = tip.frf
    size = np.where(frf.valid, np.abs(frf.values[:, 0, 0]), np.nan)
    spread = 2 * tip.tip.deviation[:, 0]
    axes.set_yscale("log")
    axes.fill_between(frf.frequencies, np.maximum(size - spread, 1e-3 * size), size + spread, color="0.8", lw=0)
    axes.plot(frf.frequencies, size, "C0", lw=1, label="predicted, with two standard errors")
    axes.plot(true.frequencies, np.abs(true.values[:, 0, 0]), "k--", lw=1, label="truth")
    axes.set(xlabel="frequency (Hz)", ylabel="receptance at the tip, X (m/N)", xlim=BAND, ylim=(1e-8, 1e-4))
    axes.legend(frameon=False, fontsize=8, loc="upper right")


def draw_limits(axes: Axes, lobes: StabilityLobes, low: NDArray[Any], high: NDArray[Any], true: StabilityLobes) -> None:
    """Draw the predicted limits with their band, and the true ones."""
    rpm = lobes.spindle_speeds_rpm
    axes.fill_between(rpm, 1e3 * low, 1e3 * np.minimum(high, DEEPEST), color="0.8", lw=0)
    axes.plot(rpm, 1e3 * lobes.depth_limits, "C0", lw=1, label="predicted, 95 %")
    axes.plot(rpm, 1e3 * true.depth_limits, "k--", lw=1, label="truth")
    axes.set(xlabel="spindle speed (rpm)", ylabel="depth limit (mm)", ylim=(0, 1e3 * DEEPEST))
    axes.legend(frameon=False, fontsize=8)


def main(picture: Path) -> None:
    """Tap two blanks, predict the end mill, and compare its limits with the truth."""
    with tempfile.TemporaryDirectory() as folder:
        write_taps(Path(folder))
        tip = predicted(Path(folder))
    speeds = np.linspace(*SPEEDS) * np.pi / 30
    model = fit(tip.frf, band=BAND).model
    true_frf = true_tip(np.arange(20.0, 6000.0, 2.5))
    true_model = fit(true_frf, band=(100.0, 5500.0)).model
    lobes = certified_lobes(model, CUT, speeds, DEEPEST)
    true = certified_lobes(true_model, CUT, speeds, DEEPEST)
    band = limit_band(model, CUT, lobes, DEEPEST)
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_frf(left, tip, true_frf)
    draw_limits(right, lobes, band.low, band.high, true)
    figure.savefig(picture, dpi=150)
    known = np.isfinite(true.depth_limits) & np.isfinite(band.low)
    inside = (true.depth_limits >= band.low) & (true.depth_limits <= band.high)
    print(tip)
    print(f"the true limits lie in the band at {inside[known].sum()} of {known.sum()} speeds")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("another_tool.png"))
