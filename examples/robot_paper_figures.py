"""Two figures of two papers, with the robots that come along: frequencies along a path, and FRFs at three poses.

Run it: `python examples/robot_paper_figures.py PATH.png FRFS.png`. The first is Fig. 7 of Mousavi et al. with a
substitute for their Staubli: natural frequencies of the first modes along a line of 1.1 m. The second is Fig. 7 of Chen
et al. 2026 from their printed tables, with rigid and with flexible links; the frequencies that they predicted and
measured are marked, and are not those that their tables give.
"""

import sys
from pathlib import Path

import numpy as np

from millfrf.figures import COLOURS, LINE_STYLES, house_style, new_figure, panel_letter, save_figure
from millfrf.robot_model import frequencies_over, in_posture, read_planar_robot, read_spatial_robot, tool_down

STAUBLI = read_spatial_robot("staubli_rx170").robot
CHEN = read_planar_robot("chen_2026")
PLACES = np.linspace(0.4, 1.5, 45)
"""y of the path in the paper's axes, m: the reach of the robot."""

LINES = np.linspace(5.0, 40.0, 1401)


def along_the_path(count: int = 6) -> np.ndarray:
    """Lowest natural frequencies over :data:`PLACES`, Hz, (n_places, count)."""
    table, _ = frequencies_over(STAUBLI, [tool_down([reach, 0.0, 0.85]) for reach in PLACES], count)
    return table


def variations(table: np.ndarray) -> np.ndarray:
    """By how much each mode varies along the path, of its largest frequency."""
    return np.asarray(np.ptp(table, axis=0) / table.max(axis=0))


def at_the_poses(links: bool) -> dict[str, np.ndarray]:
    """Size of the receptance along the reach at each pose, m/N."""
    result = {}
    for name, angles in CHEN.poses.items():
        model = in_posture(CHEN, angles, links=links).known_model()
        reach = model.responses.index("TCP:+X")
        result[name] = np.abs(model.receptance(LINES)[:, reach, reach])
    return result


def draw_path(picture: Path) -> None:
    """Frequencies along the path, and what each mode has lost of its largest."""
    table = along_the_path()
    with house_style():
        figure = new_figure(75.0)
        left, right = figure.subplots(1, 2)
        for mode in range(table.shape[1]):
            style = {"color": COLOURS[mode], "linestyle": LINE_STYLES[mode], "label": f"mode {mode + 1}"}
            left.plot(PLACES, table[:, mode], **style)
            right.plot(PLACES, 100 * (1 - table[:, mode] / table[:, mode].max()), **style)
        right.axhline(40, color="0.5", linewidth=0.7)
        left.set_ylabel("Natural frequency (Hz)")
        right.set_ylabel("Below the mode's largest (%)\nthin line: the paper's 40 %")
        for number, axes in enumerate((left, right)):
            axes.set_xlabel("Reach (m)")
            panel_letter(axes, number)
        handles, labels = left.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        save_figure(figure, picture)


def draw_frfs(picture: Path) -> None:
    """Receptances at the three poses, a panel each, with the published first modes."""
    rigid, flexible = at_the_poses(links=False), at_the_poses(links=True)
    with house_style():
        figure = new_figure(70.0)
        panels = figure.subplots(1, 3, sharey=True)
        for number, (name, axes) in enumerate(zip(CHEN.poses, panels, strict=True)):
            axes.semilogy(LINES, 1e6 * rigid[name], color=COLOURS[0], label="printed table, rigid links")
            axes.semilogy(
                LINES, 1e6 * flexible[name], color=COLOURS[1], linestyle=LINE_STYLES[1], label="with links (--links)"
            )
            axes.axvline(CHEN.measured[name], color=COLOURS[2], linestyle="-.", label="measured first mode")
            axes.axvline(CHEN.predicted[name], color="0.5", linestyle=":", label="the paper's prediction")
            axes.set_xlabel(f"Frequency (Hz), {name}")
            panel_letter(axes, number)
        panels[0].set_ylabel("Receptance along the reach (um/N)")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=2)
        save_figure(figure, picture)


def main(pictures: list[Path]) -> None:
    """Print the figures' numbers; draw both where two names are given."""
    table = along_the_path()
    for mode, share in enumerate(variations(table)):
        print(f"mode {mode + 1}: {table[0, mode]:.1f} to {table[-1, mode]:.1f} Hz, varies by {100 * share:.0f} %")
    for links in (False, True):
        first = [in_posture(CHEN, angles, links=links).frequencies[0] for angles in CHEN.poses.values()]
        print(f"{'flexible' if links else 'rigid'} links: {', '.join(f'{value:.2f}' for value in first)} Hz")
    if len(pictures) == 2:
        draw_path(pictures[0])
        draw_frfs(pictures[1])


if __name__ == "__main__":
    main([Path(name) for name in sys.argv[1:]])
