"""Joint laws with additional shape parameters, and the joint law of free form."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from millfrf.core import Real

from ..joints.joint_law import POINTS, JointLaw, JointMotion, saturated
from .protocol import JointPhysics, Parameter, reported_name


def spread_yields(typical: float, spread: float, count: int) -> Real:
    """Return yields around a typical one, evenly spread in the logarithm over ``spread``, (count,)."""
    steps = (np.arange(count) + 0.5) / count
    return np.asarray(typical * np.exp(spread * (steps - 0.5)))


@dataclass(frozen=True)
class WiderFriction:
    """Friction over velocity whose saturation has a free sharpness.

    A sharpness of 2 gives ``s / sqrt(1 + s^2)``; about 2.6 is close to the hyperbolic tangent, 1 to the arctangent.
    """

    parameters: tuple[Parameter, ...]
    name: str = "wider_friction"
    equation: str = "g = F_c s / (1 + |s|^n)^(1/n), s = v / v0"
    source: str = "Armstrong-Helouvry, Dupont & Canudas de Wit 1994, Automatica 30"
    confusable_with: tuple[str, ...] = ()

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return (np.array([1.0, 0.05 * motion.velocity, 2.0]),)

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        smooth = max(values[1], 4e-4 * motion.speed)
        return JointLaw(
            speed=motion.speed, damping=values[0] / smooth * saturated(motion.velocities, smooth, values[2])
        )


@dataclass(frozen=True)
class WiderPresliding:
    """Sliders in parallel whose yields have a free spread; together they slide at the force F_c."""

    parameters: tuple[Parameter, ...]
    name: str = "wider_presliding"
    equation: str = "g = F_c p(x), elastic-plastic elements of equal force whose yields spread in their logarithm"
    source: str = "Iwan 1966, J. Applied Mechanics 33"
    confusable_with: tuple[str, ...] = ()

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return (np.array([1.0, 0.05 * motion.deflection, 0.8]),)

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        elements = 10
        yields = spread_yields(max(values[1], 1e-3 * motion.deflection), 2 * values[2], elements)
        return JointLaw(springs=values[0] / elements / yields, yields=yields)


@dataclass(frozen=True)
class WiderDamping:
    """Damping that is proportional to any power of the velocity over its typical value."""

    parameters: tuple[Parameter, ...]
    name: str = "wider_damping"
    equation: str = "g = c |v|^n sign v, c at v0 as of the square"
    source: str = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    confusable_with: tuple[str, ...] = ()

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return (np.array([1.0, 2.0]),)

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        v, typical = motion.velocities, motion.velocity
        return JointLaw(
            speed=motion.speed,
            damping=values[0] * typical**2 * np.sign(v) * (np.abs(v) / typical) ** values[1],
        )


SHARPNESS = Parameter("sharpness", "", 0.3, 0.7, 12.0)
SPREAD = Parameter("spread", "", 0.2, 0.05, 3.0)
POWER = Parameter("power", "", 0.1, 0.6, 4.0)


class WithLinearPart:
    """A joint law ``g + k x + c v``.

    The data cannot distinguish the linear part from errors of the modal parameters. If both are fitted, the prior
    decides between them. The unit of k in a fit is a tenth of the structure's stiffness at the joint, and the unit of c
    a tenth of this stiffness over the motion's typical frequency.
    """

    def __init__(self, inner: JointPhysics, motion: JointMotion) -> None:
        self.inner = inner
        self.name = inner.name
        self.equation = f"{inner.equation} + k x + c v"
        self.source = inner.source
        self.confusable_with = inner.confusable_with
        unit = 0.1 * motion.stiffness
        self.parameters: tuple[Parameter, ...] = (
            *inner.parameters,
            Parameter("linear_stiffness_n_per_m", "N/m", unit),
            Parameter("linear_damping_ns_per_m", "N s/m", unit * motion.deflection / max(motion.velocity, 1e-300)),
        )

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return tuple(np.append(start, [0.0, 0.0]) for start in self.inner.starts(motion))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        plain = self.inner.law(values[:-2], motion)
        reach = plain.reach if len(plain.stiffness) else motion.reach
        speed = plain.speed if len(plain.damping) else motion.speed
        return replace(
            plain,
            reach=reach,
            stiffness=_with_line(plain.stiffness, reach, float(values[-2])),
            speed=speed,
            damping=_with_line(plain.damping, speed, float(values[-1])),
        )


def _with_line(table: Real, reach: float, slope: float) -> Real:
    """Add a straight line to a table over [-reach, reach]; an empty table counts as zero."""
    line = slope * np.linspace(-reach, reach, len(table) or 3)
    return np.asarray(table + line if len(table) else line)


KNEES = (0.2, 0.5, 1.0, 2.0)  # knees of saturating springs, as multiples of the typical deflection

SPEEDS = (0.01, 0.03, 0.1, 0.3, 1.0)  # velocities at which friction saturates, as multiples of the typical velocity

YIELDS = (0.02, 0.05, 0.12, 0.3, 0.7, 1.5)  # yields of elastic-plastic elements, as multiples of the typical deflection

SHAPES = {"x": len(KNEES) + 5, "v": len(SPEEDS) + 3, "m": len(YIELDS), "t": 2}  # number of shapes of each family

FREE_FORM = "free_form"  # name of a law of free form in a model file


@dataclass(frozen=True)
class FreeForm:
    """A law with added shapes, each with a fitted factor: ``g + sum_k c_k s_k(x, v, memory, t)``.

    It is not a cause. It shows what a change of a law's form could explain, and is used for predictions if the textbook
    form of an accepted law is inexact. ``kinds`` are the families of the shapes, letters of ``xvmt``: deflection (x),
    velocity (v), memory (m), time (t).
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
    def reported_as(self) -> str:
        """Name of the law whose form is free."""
        return reported_name(self.law_of)

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return no start: a free form always starts from a fitted law."""
        return ()

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        count = len(self.law_of.parameters)
        law = self.law_of.law(values[:count], motion)
        factors = list(_unit_force(motion) * values[count:])
        changes: dict[str, Any] = {}
        if "x" in self.kinds:
            reach = law.reach if len(law.stiffness) else motion.reach
            shapes = _over_deflection(reach / motion.deflection)
            changes |= {"reach": reach, "stiffness": _with_shapes(law.stiffness, shapes, factors)}
        if "v" in self.kinds:
            speed = law.speed if len(law.damping) else motion.speed
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
        """Return the change of the law for a unit of each shape's factor; the force is linear in the factors."""
        law = self.law(values, motion)
        unit, none = _unit_force(motion), np.zeros(len(law.springs))
        plain = JointLaw(reach=law.reach, speed=law.speed, springs=none, yields=none)
        changes: list[JointLaw] = []
        if "x" in self.kinds:
            shapes = _over_deflection(law.reach / motion.deflection)
            changes += [replace(plain, stiffness=unit * shape) for shape in shapes]
        if "v" in self.kinds:
            shapes = _over_velocity(law.speed / motion.velocity)
            changes += [replace(plain, damping=unit * shape) for shape in shapes]
        if "m" in self.kinds:
            units = np.diag(unit * _elements(motion)[1])
            law_springs = np.zeros((len(units), len(none) - len(units)))
            changes += [replace(plain, springs=springs) for springs in np.hstack([law_springs, units])]
        if "t" in self.kinds:
            changes += [replace(plain, ramp=unit / motion.deflection), replace(plain, bend=unit / motion.deflection)]
        return tuple(changes)


def families(law: JointLaw) -> str:
    """Return the families of a law, letters of ``xvmt``.

    >>> families(JointLaw(ramp=2.0)), families(JointLaw(damping=np.linspace(-1, 1, 9)))
    ('t', 'v')
    """
    if law.ramp or law.bend:
        # the table over deflection of a drift only states at which time the nominal model is valid
        return "t"
    sizes = {"x": len(law.stiffness), "v": len(law.damping), "m": len(law.springs)}
    return "".join(kind for kind, size in sizes.items() if size)


def _unit_force(motion: JointMotion) -> float:
    """Return the unit force of a shape, N: a hundredth of the static stiffness times the typical deflection."""
    return 0.01 * motion.stiffness * motion.deflection


def _elements(motion: JointMotion) -> tuple[Real, Real]:
    """Return the yields of the added elements, and for each element the spring stiffness that gives the force 1."""
    yields = np.array(YIELDS) * motion.deflection
    return yields, 1 / np.minimum(yields, motion.deflection)


@lru_cache(maxsize=8)  # a fit needs the same shapes at every step
def _over_deflection(end: float) -> Real:
    """Return shapes of the force over deflections up to ``end`` typical deflections: knees and powers."""
    x = np.linspace(-end, end, POINTS)
    knees = [saturated(x, knee, 4.0) / max(knee, 1.0) for knee in KNEES]
    return _read_only([*knees, x, x**2, x * np.abs(x), x**3 / 3, x**5 / 15])


@lru_cache(maxsize=8)
def _over_velocity(end: float) -> Real:
    """Return shapes of the force over velocities up to ``end`` typical velocities: saturating friction and powers."""
    v = np.linspace(-end, end, POINTS)
    return _read_only([*(np.tanh(v / speed) for speed in SPEEDS), v, v * np.abs(v), v**3 / 3])


def _read_only(shapes: list[Real]) -> Real:
    """Return shapes (n, POINTS) as a read-only array, which can be cached."""
    result = np.array(shapes)
    result.flags.writeable = False
    return result


def _with_shapes(table: Real, shapes: Real, factors: list[float]) -> Real:
    """Add shapes to a law's table; an empty table counts as zero. The factors are removed from the list ``factors``."""
    added = np.array([factors.pop(0) for _ in shapes]) @ shapes
    if not len(table):
        return np.asarray(added)
    if len(table) == POINTS:
        return np.asarray(added + table)
    return np.asarray(added + np.interp(np.linspace(-1.0, 1.0, POINTS), np.linspace(-1, 1, len(table)), table))
