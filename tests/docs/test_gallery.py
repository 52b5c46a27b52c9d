"""Every program of the gallery runs and leaves figures, which say in words what they show."""

import runpy
from pathlib import Path

import matplotlib as mpl
import pytest

PROGRAMS = sorted((Path(__file__).resolve().parents[2] / "examples" / "gallery").glob("show_*.py"))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_a_program_of_the_gallery_leaves_figures_with_words(program: Path) -> None:
    mpl.use("Agg")
    from matplotlib import pyplot

    pyplot.close("all")
    runpy.run_path(str(program))
    figures = [pyplot.figure(number) for number in pyplot.get_fignums()]
    assert figures
    for figure in figures:
        assert len(str(figure.get_label()).split()) > 5
        assert all(axes.get_xlabel() and axes.get_ylabel() for axes in figure.axes if axes.has_data() and axes.axison)
    pyplot.close("all")
