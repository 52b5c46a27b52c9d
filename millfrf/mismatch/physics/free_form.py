"""A joint's law whose form is free: shapes over deflection, velocity, memory and time are added to it."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from millfrf.core import Real

from ..joints.joint_law import JointLaw, JointMotion, saturated
from .protocol import JointPhysics, Parameter, answer_name

KNEES = (0.2, 0.5, 1.0, 2.0)
"""Knees of springs that saturate, in typical deflections."""

SPEEDS = (0.01, 0.03, 0.1, 0.3, 1.0)
"""Speeds at which friction saturates, in typical speeds."""

YIELDS = (0.02, 0.05, 0.12, 0.3, 0.7, 1.5)
"""Deflections at which elastic-plastic elements yield, in typical ones."""

SHARPNESS = 4.0
"""Sharpness of the knees of springs."""

POINTS = 8193
"""Points of the tables."""

UNIT = 0.01
"""Force of a shape's unit, over that of the structure's static stiffness at the typical deflection."""


SHAPES = {"x": len(KNEES) + 5, "v": len(SPEEDS) + 3, "m": len(YIELDS), "t": 2}
"""Number of shapes of each family."""

FREE_FORM = "free_form"
"""Name under which a law of free form stands in a model's file."""


@dataclass(frozen=True)
class FreeForm:
    """A law with shapes that are added to it, each with a factor of its own: ``g + sum_k c_k s_k(x, v, memory, t)``.

    It is no cause of its own: it shows what a change of a law's form could explain, and predicts where a law is found
    whose textbook form is not quite the true one.

    Parameters
    ----------
    law_of
        The law whose form is free.
    kinds
        Families of the shapes, letters of ``xvmt``.
    """

    law_of: JointPhysics
    kinds: str
    name: str = FREE_FORM
    equation: str = "g + sum_k c_k s_k"
    source: str = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 7"
    confusable_with: tuple[str, ...] = ()

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Numbers of the law, then one factor for each shape."""
        count = sum(SHAPES[kind] for kind in self.kinds)
        return (*self.law_of.parameters, *(Parameter(f"shape_{k + 1}", "", 1.0) for k in range(count)))

    @property
    def answers_as(self) -> str:
        """Name of the law whose form is free."""
        return answer_name(self.law_of)

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return no start: the form is freed where a law was fitted."""
        del motion
        return ()

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        own = len(self.law_of.parameters)
        law = self.law_of.law(values[:own], motion)
        factors = list(_unit(motion) * values[own:])
        changes: dict[str, Any] = {}
        if "x" in self.kinds:
            reach = _reach(law, motion)
            shapes = _over_deflection(reach / motion.deflection)
            changes |= {"reach": reach, "stiffness": _with_shapes(law.stiffness, shapes, factors)}
        if "v" in self.kinds:
            speed = _speed(law, motion)
            shapes = _over_velocity(speed / motion.velocity)
            changes |= {"speed": speed, "damping": _with_shapes(law.damping, shapes, factors)}
        if "m" in self.kinds:
            yields, units = _elements(motion)
            springs = units * [factors.pop(0) for _ in YIELDS]
            changes |= {"springs": np.append(law.springs, springs), "yields": np.append(law.yields, yields)}
        if "t" in self.kinds:
            ramp, bend = (factor / motion.deflection for factor in factors)
            changes |= {"ramp": law.ramp + ramp, "bend": law.bend + bend}
        return replace(law, **changes)

    def law_changes(self, values: Real, motion: JointMotion) -> tuple[JointLaw, ...]:
        """Return what a unit of each shape's factor changes of the law: the force is linear in them."""
        law = self.law(values, motion)
        unit, none = _unit(motion), np.zeros(len(law.springs))
        plain = JointLaw(reach=law.reach, speed=law.speed, springs=none, yields=none)
        found: list[JointLaw] = []
        if "x" in self.kinds:
            shapes = _over_deflection(law.reach / motion.deflection)
            found += [replace(plain, stiffness=unit * shape) for shape in shapes]
        if "v" in self.kinds:
            shapes = _over_velocity(law.speed / motion.velocity)
            found += [replace(plain, damping=unit * shape) for shape in shapes]
        if "m" in self.kinds:
            units = np.diag(unit * _elements(motion)[1])
            own = np.zeros((len(units), len(none) - len(units)))
            found += [replace(plain, springs=springs) for springs in np.hstack([own, units])]
        if "t" in self.kinds:
            found += [replace(plain, ramp=unit / motion.deflection), replace(plain, bend=unit / motion.deflection)]
        return tuple(found)


def families(law: JointLaw) -> str:
    """Families that a law is of, letters of ``xvmt``.

    Parameters
    ----------
    law
        Law of a joint's force.

    Examples
    --------
    >>> families(JointLaw(ramp=2.0)), families(JointLaw(damping=np.linspace(-1, 1, 9)))
    ('t', 'v')
    """
    if law.ramp or law.bend:
        # its part over the deflection is what the nominal model holds at
        return "t"
    has = {"x": len(law.stiffness), "v": len(law.damping), "m": len(law.springs)}
    return "".join(kind for kind, there in has.items() if there)


def _unit(motion: JointMotion) -> float:
    """Force of a shape's unit, N."""
    return UNIT * motion.stiffness * motion.deflection


def _reach(law: JointLaw, motion: JointMotion) -> float:
    """End of the table over the deflection: it reaches as far as the law's own."""
    return law.reach if len(law.stiffness) else motion.reach


def _speed(law: JointLaw, motion: JointMotion) -> float:
    """End of the table over the velocity, likewise."""
    return law.speed if len(law.damping) else motion.speed


def _elements(motion: JointMotion) -> tuple[Real, Real]:
    """Yields of the elements that are added, and the spring of each for a force of one."""
    yields = np.array(YIELDS) * motion.deflection
    return yields, 1 / np.minimum(yields, motion.deflection)


@lru_cache(maxsize=8)
def _over_deflection(end: float) -> Real:
    """Shapes over deflections up to ``end`` typical ones: knees, powers, and an asymmetric one. A fit asks often."""
    x = _grid(end)
    knees = [saturated(x, knee, SHARPNESS) / max(knee, 1.0) for knee in KNEES]
    return _kept([*knees, x, x**2, x * np.abs(x), x**3 / 3, x**5 / 15])


@lru_cache(maxsize=8)
def _over_velocity(end: float) -> Real:
    """Shapes over velocities up to ``end`` typical ones: friction that saturates, and powers. A fit asks often."""
    v = _grid(end)
    return _kept([*(np.tanh(v / speed) for speed in SPEEDS), v, v * np.abs(v), v**3 / 3])


def _kept(shapes: list[Real]) -> Real:
    """Shapes (n, POINTS) that nobody can change."""
    result = np.array(shapes)
    result.flags.writeable = False
    return result


def _grid(end: float) -> Real:
    """Evenly spaced points of a table."""
    return np.linspace(-end, end, POINTS)


def _with_shapes(table: Real, shapes: Real, factors: list[float]) -> Real:
    """A law's own table, or none, with shapes by their factors, which are taken from the list."""
    added = np.array([factors.pop(0) for _ in shapes]) @ shapes
    if not len(table):
        return np.asarray(added)
    if len(table) == POINTS:
        return np.asarray(added + table)
    return np.asarray(added + np.interp(_grid(1.0), np.linspace(-1, 1, len(table)), table))
