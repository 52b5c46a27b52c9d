"""`Question`: what a file leaves open, asked at the key in the template."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Question:
    """A key that the user must fill in, with what must be known for it.

    Parameters
    ----------
    text
        The question, without a mark at its end.
    refused
        TOML value that the reading command refuses, for keys that it would otherwise fill in itself; empty: none.
    open
        Whether it must be answered; a key that may stay out carries the text without the mark.
    """

    text: str
    refused: str = ""
    open: bool = True
