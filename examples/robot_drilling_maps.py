"""Drilling over a work area: deviation of the robot, with the process, and their uncertainty (Ferreras-Higuero et al.).

Run it: `python examples/robot_drilling_maps.py [PICTURE.png]`. Figs. 13 to 15 of the paper with a substitute robot: a
drill of 10 mm at 2500 rpm in aluminium, two feeds. The paper prints neither robot nor feeds nor the values of the
process's part, which is computed here from a runout of 20 um and a carbide drill of 60 mm. Printed at the end: what
share of the uncertainty machining makes, against the paper's "up to 40 %".
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from millfrf.cutting import Drill, bending_stiffness, drilling_load, fitted_to_catalogue, settled_drill
from millfrf.figures import house_style, new_figure, panel_letter, save_figure
from millfrf.robot_model import (
    DeviationMap,
    LoadUncertainty,
    ProcessDeviation,
    UncertaintyBudget,
    deformation_uncertainty,
    deviation_map,
    drilling_wrench,
    measured_machining_uncertainty,
    process_deviation,
    read_spatial_robot,
    tool_down,
)

ROBOT = read_spatial_robot("kuka_kr90_r3100").robot
REPEATABILITY = 40e-6
"""The paper's robot after ISO 9283, m."""

FEEDS = (0.1e-3, 0.2e-3)
"""m per revolution; assumed."""

RUNOUT, OVERHANG = 20e-6, 60e-3
DOWN = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class Maps:
    """Deviation of the robot, of the process, and the budget at every place that is reached (None elsewhere)."""

    robot: DeviationMap
    process: ProcessDeviation
    budgets: tuple[UncertaintyBudget | None, ...]

    @property
    def sizes(self) -> np.ndarray:
        """Length of delta_robot, m, (n,)."""
        return np.asarray(np.linalg.norm(self.robot.deviations, axis=1))

    @property
    def work(self) -> np.ndarray:
        """``|delta_robot| + delta_mach``, m: Eq. 2 with both to the same side."""
        return self.sizes + self.process.total

    @property
    def uncertainty(self) -> np.ndarray:
        """U_work, m, (n,)."""
        return np.array([np.nan if each is None else each.work for each in self.budgets])


def area(shape: tuple[int, int]) -> list:
    """Places of a vertical drill, 0.7 m above the floor."""
    return [tool_down([x, y, 0.7]) for x in np.linspace(1.1, 2.3, shape[0]) for y in np.linspace(-0.8, 0.8, shape[1])]


def maps(diameter: float, feed: float, shape: tuple[int, int] = (25, 33)) -> Maps:
    """Compute the three maps for one drill and feed."""
    drill = Drill(diameter)
    forces = fitted_to_catalogue(drill)
    load = drilling_load(drill, feed, *forces)
    result = deviation_map(ROBOT, area(shape), load)
    settled = settled_drill(drill, feed, *forces, RUNOUT, 1 / bending_stiffness(drill, OVERHANG))
    wrench, known = drilling_wrench(load, DOWN), LoadUncertainty()
    machining = measured_machining_uncertainty(diameter)
    budgets = tuple(
        UncertaintyBudget(REPEATABILITY, deformation_uncertainty(ROBOT, q, wrench, known), machining) if there else None
        for q, there in zip(result.q, result.reached, strict=True)
    )
    return Maps(result, process_deviation(settled, RUNOUT), budgets)


def draw(found: dict[float, Maps], picture: Path, shape: tuple[int, int] = (25, 33)) -> None:
    """A row for each feed: delta_robot, with the process, and the uncertainty."""
    labels = (r"$\delta_{robot}$ (mm)", r"$\delta_{work}$ (mm)", r"$U_{work}$, k = 2 (mm)")
    fields = {feed: [1e3 * item for item in (each.sizes, each.work, each.uncertainty)] for feed, each in found.items()}
    with house_style():
        figure = new_figure(110.0)
        panels = figure.subplots(len(found), 3, sharex=True, sharey=True, squeeze=False)
        for row, (feed, each) in enumerate(found.items()):
            x, y = (each.robot.positions[:, axis].reshape(shape) for axis in (0, 1))
            for column, label in enumerate(labels):
                every = np.concatenate([fields[item][column] for item in found])
                axes, shown = panels[row, column], np.ma.masked_invalid(fields[feed][column].reshape(shape))
                drawn = axes.pcolormesh(
                    y, x, shown, shading="nearest", cmap="viridis", vmin=np.nanmin(every), vmax=np.nanmax(every)
                )
                lines = axes.contour(y, x, shown, 5, colors="white", linewidths=0.7)
                axes.clabel(lines, fontsize=7)
                axes.grid(visible=False)
                axes.set_aspect("equal")
                panel_letter(axes, 3 * row + column)
                if row == len(found) - 1:
                    axes.set_xlabel("y (m)")
                    figure.colorbar(drawn, ax=panels[:, column], label=label, location="bottom", pad=0.01, aspect=30)
            panels[row, 0].set_ylabel(f"{1e3 * feed:g} mm a revolution\nx (m)")
        save_figure(figure, picture)


def shares(shape: tuple[int, int] = (7, 5)) -> dict[tuple[float, float], tuple[float, float, float]]:
    """Machining's share of U_work^2: without deformation, and the least and the most over the area."""
    result = {}
    for diameter in (8e-3, 12e-3):
        for feed in FEEDS:
            budgets = [each for each in maps(diameter, feed, shape).budgets if each is not None]
            alone = UncertaintyBudget(REPEATABILITY, 0.0, budgets[0].machining).machining_share
            there = [each.machining_share for each in budgets]
            result[diameter, feed] = (alone, min(there), max(there))
    return result


def main(picture: Path | None = None) -> dict[float, Maps]:
    """Print the maps' ranges and the shares; draw where asked."""
    result = {feed: maps(10e-3, feed) for feed in FEEDS}
    for feed, each in result.items():
        robot, uncertainty = 1e3 * each.sizes, 1e3 * each.uncertainty
        print(
            f"{1e3 * feed:g} mm/rev: delta_robot {np.nanmin(robot):.2f} to {np.nanmax(robot):.2f} mm, delta_mach "
            f"{1e3 * each.process.total:.3f} mm, U_work {np.nanmin(uncertainty):.3f} to {np.nanmax(uncertainty):.3f} mm"
        )
    for (diameter, feed), (alone, least, most) in shares().items():
        print(
            f"{1e3 * diameter:g} mm, {1e3 * feed:g} mm/rev: machining makes {100 * alone:.0f} % of U^2 without "
            f"deformation, {100 * least:.0f} to {100 * most:.0f} % with it (paper: up to 40 %)"
        )
    if picture is not None:
        draw(result, picture)
    return result


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
