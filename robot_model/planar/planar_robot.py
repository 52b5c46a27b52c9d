"""`PlanarRobot`: links and torsional joint springs in one vertical plane (Chen et al. 2026)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..finite_elements.section import Section

Real = NDArray[np.float64]

TIP_IN_PLANE = ("TCP:+X", "TCP:+Z", "TCP:-RY")
"""Reach, height, and the rotation that turns reach towards height."""


@dataclass(frozen=True)
class PlanarRobot:
    """A chain of uniform links; each joint is a torsional spring against the link before it.

    Parameters
    ----------
    lengths : (n_links,), m
        Lengths of the links.
    masses : (n_links,), kg
        Masses of the links.
    stiffness : (n_links,), N m/rad
        Stiffness of the joint before each link; the first stands on the base.
    damping_ratios : (n_links,)
        Damping ratios, one a mode of the rigid model; ``2 zeta`` is taken for the loss factor of link and joint in the
        exact model.
    sections
        Cross-sections of the links where they are flexible; None: the links are rigid.

    Raises
    ------
    InputError
        Columns of unequal length, or values that are not positive.
    """

    lengths: Real
    masses: Real
    stiffness: Real
    damping_ratios: Real
    sections: tuple[Section, ...] | None = None

    def __post_init__(self) -> None:
        columns = {"lengths": self.lengths, "masses": self.masses, "stiffness": self.stiffness}
        for name, column in columns.items():
            if len(column) != len(self.lengths) or not np.all(np.asarray(column) > 0):
                raise InputError(f"planar robot: {name} = {np.asarray(column)} must be positive, one for each link")
        if len(self.damping_ratios) != len(self.lengths) or np.any(np.asarray(self.damping_ratios) < 0):
            raise InputError(f"planar robot: damping_ratios = {self.damping_ratios} must be 0 or more, one a link")
        if self.sections is not None and len(self.sections) != len(self.lengths):
            raise InputError(f"planar robot: {len(self.sections)} sections for {len(self.lengths)} links")

    def directions(self, angles: Real) -> Real:
        """Absolute angle of each link from the horizontal, rad, from the relative joint angles (n_links,)."""
        given = np.asarray(angles, dtype=float)
        if given.shape != self.lengths.shape:
            raise InputError(f"planar robot: {given.size} joint angles for {len(self.lengths)} links; give one each")
        return np.cumsum(given)

    def tip(self, angles: Real) -> Real:
        """Reach and height of the tip from the first joint, m, shape (2,)."""
        directions = self.directions(angles)
        return np.array([self.lengths @ np.cos(directions), self.lengths @ np.sin(directions)])
