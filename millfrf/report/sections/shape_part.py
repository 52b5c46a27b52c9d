"""Mode shapes in a report: table, auto-MAC with MPC and MPD, and every vector in the complex plane."""

from collections.abc import Sequence

from estimation import Geometry
from millfrf.figures import assurance_figure, compass_figure, mode_figure, moving_shapes, shapes_figure
from modal_fit import ModalModel, ModeShapes

from ...tables import Table, shape_table, shapes_of
from ..section import Picture, picture_of

FEW = 6
"""Degrees of freedom up to which right and left vectors are drawn with a name at each component."""

MOST = 40
"""Modes that are drawn."""

ALIKE = 0.9
"""MAC from which two modes are told as alike."""


def shape_part(
    name: str, model: ModalModel, geometries: Sequence[tuple[str, Geometry]] = ()
) -> tuple[tuple[Table, ...], tuple[Picture, ...], tuple[str, ...]]:
    """Give tables, pictures and sentences on the shapes of a model, empty where it has none.

    Parameters
    ----------
    name
        Name of the model's file.
    model
        Modal model with at least two degrees of freedom on one side.
    geometries
        Name of the file, and places of the points, of each geometry; the first that knows a point is drawn.
    """
    shapes, table = shapes_of(model), shape_table(model, f"{name}: mode shapes")
    if shapes is None or table is None:
        return (), (), ()
    pictures = []
    if 1 < len(model.poles) <= MOST:
        pictures.append(_assurance(name, model, shapes))
    if max(len(model.responses), len(model.excitations)) <= FEW:
        pictures.append(_right_and_left(name, model))
    elif len(model.poles) <= MOST:
        pictures.append(_compasses(name, model, shapes))
    moving, missing = _moving(name, model, shapes, geometries)
    return (table,), (*moving, *pictures), (*_alike(name, model, shapes), *missing)


def _moving(
    name: str, model: ModalModel, shapes: ModeShapes, geometries: Sequence[tuple[str, Geometry]]
) -> tuple[tuple[Picture, ...], tuple[str, ...]]:
    """Shapes on the first geometry that knows a point of the model, and a sentence on what does not move."""
    for file, geometry in geometries:
        moving = moving_shapes(geometry, model, shapes)
        if moving is None:
            continue
        nodes = list(dict.fromkeys(dof.split(":")[0] for dof in shapes.dofs))
        unknown = [node for node in nodes if node not in geometry.nodes]
        still = len(geometry.nodes) - int(moving.measured.sum())
        told = [f"{still} of its {len(geometry.nodes)} nodes were not measured and do not move"] if still else []
        told += [f"{', '.join(unknown[:5])} stand in no geometry and are not drawn"] if unknown else []
        caption = (
            f"{name}: mode shapes ({shapes.side} vectors) on {file}. Grey: at rest; blue: displaced, dots where it was "
            "measured. Only measured directions move."
        )
        words = f"Mode shapes of {name} on the geometry of {file}"
        picture = picture_of(shapes_figure(moving), caption, words, moving=moving)
        return (picture,), tuple(f"{name} on {file}: {one}." for one in told)
    if not geometries:
        return (), ()
    return (), (f"{name}: no geometry has one of its points; its shapes are not drawn in place.",)


def _assurance(name: str, model: ModalModel, shapes: ModeShapes) -> Picture:
    caption = (
        f"{name}: (a) auto-MAC of the {shapes.side} vectors in %: dark off the diagonal means two modes that the "
        f"{len(shapes.dofs)} points cannot tell apart; (b) modal phase collinearity, 1 for a real mode; (c) mean phase "
        "deviation, 0 for a real mode."
    )
    return picture_of(assurance_figure(model, shapes), caption, "Auto-MAC matrix, MPC and MPD")


def _compasses(name: str, model: ModalModel, shapes: ModeShapes) -> Picture:
    caption = (
        f"{name}: the {len(shapes.dofs)} components of each {shapes.side} vector in the complex plane, turned to their "
        "best straight line; circle: largest component. Components on the horizontal line are a real mode; "
        "a single one off it is a doubtful point."
    )
    return picture_of(compass_figure(model, shapes), caption, "Modal vectors in the complex plane")


def _right_and_left(name: str, model: ModalModel) -> Picture:
    caption = (
        f"{name}: modal vectors in the complex plane, each scaled to its largest component. Right "
        "and left vectors agree where the structure is reciprocal; components on one line are a real mode."
    )
    return picture_of(mode_figure(model), caption, "Modal vectors")


def _alike(name: str, model: ModalModel, shapes: ModeShapes) -> tuple[str, ...]:
    if len(shapes.dofs) <= FEW:  # few points cannot tell most modes apart; the table shows it
        return ()
    f = model.natural_frequencies
    return tuple(
        f"{name}: modes {i + 1} and {j + 1} at {f[i]:.2f} and {f[j]:.2f} Hz have like shapes (MAC "
        f"{shapes.assurance[i, j]:.2f}): one mode found twice, or points that cannot tell them apart."
        for i, j in shapes.alike(ALIKE)
    )
