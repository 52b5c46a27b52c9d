"""Protocols of the causes: what a hypothesis about missing physics states."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from estimation import BandRecording
from millfrf.core import Complex, DegreeOfFreedom, Real
from modal_fit import ModalModel

from ..joints.joint_law import JointLaw, JointMotion

# Share of the typical deflection or velocity up to which dry friction yields. An element that yields later is
# hysteresis, and a force that rises with the speed beyond this share is damping.
DRY = 0.1


@dataclass(frozen=True)
class Parameter:
    """One number of a cause.

    Parameters
    ----------
    name
        Name of the number in files, with its unit as a suffix: ``delay_s``.
    unit
        SI unit of the number; empty for a number without a unit.
    unit_step
        Noticeable change of the number in a fit: a difference in ``unit``, or a relative one if ``logarithmic``.
    low, high
        Bounds of the number, in ``unit``.
    logarithmic
        Whether the number is positive and its logarithm is fitted.
    """

    name: str
    unit: str
    unit_step: float
    low: float = -np.inf
    high: float = np.inf
    logarithmic: bool = False

    def to_fit(self, value: float) -> float:
        """Return the coordinate of a number in a fit, in which changes of about one are noticeable."""
        return float(np.log(value) if self.logarithmic else value) / self.unit_step

    def from_fit(self, coordinate: float) -> float:
        """Return the number with this coordinate, clipped to the bounds."""
        scaled = coordinate * self.unit_step
        value = np.exp(np.clip(scaled, -300, 300)) if self.logarithmic else scaled
        return float(np.clip(value, self.low, self.high))


class Physics(Protocol):
    """A cause of the library.

    A cause may also have ``reported_as`` (name under which it is reported), ``drives`` (quantities that must drive the
    rig), ``acts_on_motion`` (whether it needs responses along driven axes), ``derived(values)`` (further numbers by
    name) and ``impossible(values, margin)`` (why numbers are impossible by more than their margins of error, else an
    empty text).
    """

    @property
    def name(self) -> str:
        """Name of the cause in files."""
        ...

    @property
    def equation(self) -> str:
        """Equation of the cause."""
        ...

    @property
    def source(self) -> str:
        """Source of the equation."""
        ...

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Numbers of the cause."""
        ...

    @property
    def confusable_with(self) -> tuple[str, ...]:
        """Names of causes with similar effects."""
        ...


@dataclass(frozen=True)
class Chain:
    """Matrices of a linear cause around the structure H: ``X = H (B F - K X)``, of which ``C X`` is measured."""

    # matrix C from the true to the measured responses; None is the identity, (n, n_responses, n_responses) or None
    response: Complex | None = None
    # matrix B from the measured to the true forces; None is the identity, (n, n_excitations, n_excitations) or None
    force: Complex | None = None
    # matrix K from the responses to the forces that act against F, N/m; None is zero, (n, n_excitations, n_responses)
    # or None
    feedback: Complex | None = None


@runtime_checkable
class ChainPhysics(Physics, Protocol):
    """A linear cause with a few numbers: a fault of the measuring chain, a coupling or a mass."""

    sizes: slice = slice(None)
    """Numbers that state the size of the cause: at those of ``start`` it is absent, whatever the other numbers are."""

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return the possible places: channel labels of the model, or one empty text for the whole chain."""
        return ("",)

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent or almost absent."""
        return np.zeros(len(self.parameters))

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        ...


@runtime_checkable
class JointPhysics(Physics, Protocol):
    """A law of one joint whose axis is unknown; the first number is an amplitude of the force."""

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return the numbers from which fits start: one set for each shape, with the amplitude 1."""
        ...

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force with these numbers."""
        ...


@runtime_checkable
class TwinPhysics(Protocol):
    """A joint law that differs from the law named ``twin`` with the same numbers only by a linear spring."""

    twin: str


@runtime_checkable
class PreloadedPhysics(Protocol):
    """A joint law whose force is proportional to the preload of a contact."""

    preloaded: bool


@runtime_checkable
class LimitedPhysics(Protocol):
    """A joint law whose name is valid only within limits set by the motion; beyond them it is the law ``beyond``."""

    beyond: str

    def limited(self, values: Real, motion: JointMotion) -> Real:
        """Return the numbers clipped to the limits."""
        ...

    def beyond_limits(self, values: Real, motion: JointMotion) -> bool:
        """Return whether the numbers lie beyond the limits."""
        ...


@runtime_checkable
class FaultPhysics(Physics, Protocol):
    """A fault of a recording, which is repaired before causes are searched for, and added to predictions."""

    order: int
    """Place among the faults of a prediction: tones come before a channel's limit, which clips them too."""

    def shown(self, response: Real, recording: BandRecording, start: int, term: Mapping[str, Any]) -> Real:
        """Return a predicted response (n_samples, n_responses) with the fault.

        The term is ``{name, location, parameters}``; ``start`` is the first sample after the run-in.
        """
        ...


def reported_name(physics: Physics) -> str:
    """Return the name under which a cause is reported: ``reported_as`` if it is a form of a cause, else its name."""
    return str(getattr(physics, "reported_as", physics.name))


def resonance_of(squared_period: float, damping_time: float) -> dict[str, float]:
    """Return frequency (Hz) and damping ratio of ``1 + c s + T2 s^2``, c in s and T2 in s^2; empty unless T2 > 0."""
    if squared_period <= 0:
        return {}
    root = float(np.sqrt(squared_period))
    return {"resonance_hz": 1 / (2 * np.pi * root), "damping_ratio": damping_time / (2 * root)}


def axes_of(labels: tuple[str, ...]) -> list[str]:
    """Return the axis (X, Y or Z) of each degree of freedom."""
    return [DegreeOfFreedom.parse(label).axis for label in labels]
