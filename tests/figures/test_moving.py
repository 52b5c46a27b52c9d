"""Mode shapes on a geometry: components added up as vectors, still where nothing was measured."""

import json
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest

from estimation import Geometry
from millfrf.figures import moving_shapes, shapes_figure
from modal_fit import ModalModel, mode_shapes

POLES = 2 * np.pi * np.array([10.0, 25.0]) * (-0.01 + 1j)
TURNED = np.array([np.eye(3), [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], np.eye(3), np.eye(3)])


def _model() -> ModalModel:
    shapes = np.array([[1.0, 0.5, 0.25j], [0.2, -1.0, 0.5]], dtype=complex)
    return ModalModel(POLES, shapes, np.ones((2, 1), dtype=complex), ("a:+X", "b:-X", "a:+Z"), ("a:+X",))


def _geometry() -> Geometry:
    places = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
    return Geometry(("a", "b", "c", "d"), places, TURNED, (("a", "b", "c"), ("c", "d")))


def test_components_add_up_along_the_local_axes_and_signs() -> None:
    model = _model()
    shapes = mode_shapes(model)
    moving = moving_shapes(_geometry(), model, shapes)
    assert moving is not None
    first = shapes.vectors[0]
    size = np.sqrt(np.sum(np.abs(first[[0, 2]]) ** 2))
    assert moving.shapes[0, 0] == pytest.approx(np.array([first[0], 0, first[2]]) / size)
    assert moving.shapes[0, 1] == pytest.approx(np.array([0, -first[1], 0]) / size)  # -X of an axis turned to +Y
    assert np.linalg.norm(moving.shapes, axis=2).max(axis=1) == pytest.approx(1.0)
    assert moving.measured.tolist() == [True, True, False, False]
    assert not moving.shapes[:, 2:].any()
    assert moving.lines == ((0, 1), (1, 2), (2, 3))


def test_the_page_gets_complex_shapes_and_names() -> None:
    model = _model()
    moving = moving_shapes(_geometry(), model, mode_shapes(model))
    assert moving is not None
    stated = json.loads(moving.to_json())
    assert np.array(stated["real"]) + 1j * np.array(stated["imaginary"]) == pytest.approx(moving.shapes, abs=1e-4)
    assert stated["labels"][1].startswith("2: 25.0")


def test_a_geometry_of_other_points_gives_nothing() -> None:
    other = Geometry(("x", "y"), np.zeros((2, 3)))
    assert moving_shapes(other, _model(), mode_shapes(_model())) is None


@pytest.mark.parametrize("n_modes", [2, 4])  # four modes leave two panels of a grid of six empty
def test_the_picture_has_a_panel_a_mode(n_modes: int) -> None:
    model = _model()
    chosen = np.arange(n_modes) % 2
    model = replace(model, poles=model.poles[chosen], right=model.right[chosen], left=model.left[chosen])
    moving = moving_shapes(_geometry(), model, mode_shapes(model))
    assert moving is not None
    figure = shapes_figure(moving)
    assert [axes.get_title() for axes in figure.axes] == list(moving.labels)
    figure.savefig(BytesIO(), format="svg")
