"""Every program of the gallery runs and leaves one figure, which says in words what it shows."""

import runpy
from pathlib import Path

import matplotlib as mpl
import pytest

PROGRAMS = sorted((Path(__file__).resolve().parents[2] / "examples" / "gallery").glob("show_*.py"))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_a_program_of_the_gallery_leaves_one_figure_with_words(program: Path) -> None:
    mpl.use("Agg")
    from matplotlib import pyplot

    pyplot.close("all")
    runpy.run_path(str(program))
    (number,) = pyplot.get_fignums()
    figure = pyplot.figure(number)
    assert len(str(figure.get_label()).split()) > 5
    assert all(axes.get_xlabel() and axes.get_ylabel() for axes in figure.axes if axes.has_data() and axes.axison)
    pyplot.close("all")
