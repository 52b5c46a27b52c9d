"""Pieces of a tooth period in which the same teeth cut; everything is smooth on each of them."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cutting import MillingProcess


@dataclass(frozen=True)
class Piece:
    """A stretch of the period in which the same teeth cut.

    Parameters
    ----------
    begin, end : rad
        Spindle angles of begin and end, from the beginning of the period.
    immersions : rad
        Immersion angle of each engaged tooth at ``begin``.
    """

    begin: float
    end: float
    immersions: tuple[float, ...]

    def split(self, count: int) -> list["Piece"]:
        """Cut into ``count`` equal pieces."""
        edges = np.linspace(self.begin, self.end, count + 1)
        return [
            Piece(float(a), float(b), tuple(phi + float(a) - self.begin for phi in self.immersions))
            for a, b in pairwise(edges)
        ]


def engagement_pieces(process: MillingProcess) -> list[Piece]:
    """Pieces of one tooth period (spindle angle 0 ... 2 pi / N, 0 where a tooth enters) with a tooth in the cut.

    Examples
    --------
    >>> slot_of_three = MillingProcess(3, 0.01, np.pi / 2, 1e8, 0.3, 0.0, 0.0, np.pi, 1e-4)
    >>> [(round(p.begin, 3), round(p.end, 3), len(p.immersions)) for p in engagement_pieces(slot_of_three)]
    [(0.0, 1.047, 2), (1.047, 2.094, 1)]
    """
    pitch = 2 * np.pi / process.teeth
    width = process.exit_angle - process.start_angle
    edges = [0.0, float(np.mod(width, pitch)), pitch]
    pieces = []
    for begin, end in pairwise(edges):
        middle = (begin + end) / 2
        engaged = [k for k in range(process.teeth) if middle + k * pitch < width]
        if engaged and end - begin > 1e-9 * pitch:
            pieces.append(Piece(begin, end, tuple(process.start_angle + begin + k * pitch for k in engaged)))
    return pieces
