"""The picture of what drifts."""

from pathlib import Path

from millfrf.figures import save_figure

from ....report import Picture, picture_of
from ..drift import Drifts
from ..pictures import draw_trends
from .trend_words import label_words, mode_words


def trend_pictures(folder: Path, drifts: Drifts) -> tuple[Picture, ...]:
    """Draw the most certain drifts, also as ``drifts.png``; nothing where nothing drifts.

    Parameters
    ----------
    folder
        Folder of the PNG file.
    drifts
        Trends that were looked at and found.
    """
    if not drifts.drifts:
        return ()
    words = [
        (
            f"{one.trend.series.pose}: "
            f"{mode_words(one.trend.series.mode, one.trend.series.frequency, one.trend.series.quantity)}",
            label_words(one.trend.label),
        )
        for one in drifts.drifts
    ]
    figure = draw_trends(drifts.drifts, drifts.all_trends, words)
    save_figure(figure, folder / "drifts.png")
    caption = (
        "What drifts: marks are the sets with twice the fits' standard errors, the line is the trend with its 95 % "
        "band. Grey lines are the same mode in the other poses. Also drifts.png."
    )
    return (picture_of(figure, caption, "Trends of what drifts"),)
