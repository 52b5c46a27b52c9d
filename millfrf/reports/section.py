"""Parts of a report: sections with sentences, tables, figures and folded parts."""

from dataclasses import dataclass, field, replace

from matplotlib.figure import Figure

from millfrf.core.terminal import Table
from millfrf.figures import MovingShapes, SmallSvg, ZoomedPlot, as_data_uri


@dataclass(frozen=True)
class Picture:
    """A figure with its caption.

    Parameters
    ----------
    uri
        ``data:`` address of the image.
    caption
        Content of the figure, and how to read it.
    alternative
        Text for readers who cannot see the picture.
    figure
        Figure from which files in other formats are written.
    zoomed
        Interactive version for the screen; None: only the picture.
    moving
        Animated mode shapes for the screen; None: only the picture.
    """

    uri: str
    caption: str
    alternative: str
    figure: Figure | SmallSvg = field(repr=False, compare=False)
    zoomed: ZoomedPlot | None = None
    moving: MovingShapes | None = None


def picture_of(
    figure: Figure | SmallSvg,
    caption: str,
    alternative: str,
    *,
    zoomed: ZoomedPlot | None = None,
    moving: MovingShapes | None = None,
) -> Picture:
    """Make a picture of a page from a figure.

    Parameters
    ----------
    figure
        Figure, or page of small panels.
    caption, alternative
        As in :class:`Picture`.
    zoomed, moving
        As in :class:`Picture`.
    """
    uri = figure.uri() if isinstance(figure, SmallSvg) else as_data_uri(figure)
    return Picture(uri, caption, alternative, figure, zoomed, moving)


@dataclass(frozen=True)
class Fold:
    """A part of a section that opens on a click; in print it is open.

    Parameters
    ----------
    title
        Title of the part.
    tables, pictures
        Tables and pictures, in this order.
    opened
        Whether it is open from the start.
    """

    title: str
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    opened: bool = False


@dataclass(frozen=True)
class Section:
    """One section of a page; an empty section is omitted.

    Parameters
    ----------
    title
        Heading of the section.
    sentences, tables, pictures, folds
        Contents of the section, in this order on the page.
    """

    title: str
    sentences: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    folds: tuple[Fold, ...] = ()

    @property
    def empty(self) -> bool:
        """Whether the section has no content."""
        return not (self.sentences or self.tables or self.pictures or self.folds)

    def with_more(
        self,
        sentences: tuple[str, ...] = (),
        tables: tuple[Table, ...] = (),
        pictures: tuple[Picture, ...] = (),
        folds: tuple[Fold, ...] = (),
    ) -> "Section":
        """Return the section with further content appended."""
        return replace(
            self,
            sentences=self.sentences + sentences,
            tables=self.tables + tables,
            pictures=self.pictures + pictures,
            folds=self.folds + folds,
        )

    def without_first_picture(self) -> "tuple[Picture | None, Section]":
        """Return the first picture, or None, and the section without it."""
        if not self.pictures:
            return None, self
        return self.pictures[0], replace(self, pictures=self.pictures[1:])
