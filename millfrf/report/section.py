"""What a report is made of: sections with sentences, tables and figures."""

from dataclasses import dataclass

from ..tables import Table


@dataclass(frozen=True)
class Picture:
    """A figure with its caption.

    Parameters
    ----------
    uri
        ``data:`` address of the image.
    caption
        What it shows and how to read it.
    alternative
        For readers who cannot see it.
    """

    uri: str
    caption: str
    alternative: str


@dataclass(frozen=True)
class Section:
    """One section; empty ones are left out of the page.

    Parameters
    ----------
    title
        Heading.
    sentences, tables, pictures
        In this order on the page.
    """

    title: str
    sentences: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()

    @property
    def empty(self) -> bool:
        """Nothing to show."""
        return not (self.sentences or self.tables or self.pictures)
