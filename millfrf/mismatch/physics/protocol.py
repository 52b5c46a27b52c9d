"""Protocols that every file of this folder follows: what a hypothesis about left-out physics states."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from estimation import BandRecording
from millfrf.core import Complex, DegreeOfFreedom, Real
from modal_fit import ModalModel

from ..joints.joint_law import JointLaw, JointMotion

DRY = 0.1
"""Share of the typical deflection or velocity within which dry friction gives way. An element that yields later is
hysteresis, and a force that still rises with the speed beyond it is damping of another kind."""


@dataclass(frozen=True)
class Parameter:
    """One number of a hypothesis.

    Parameters
    ----------
    name
        Name of the number as it stands in files, with its unit as a suffix: ``delay_s``.
    unit
        SI unit of the number; empty for a number without a unit.
    unit_step
        Noticeable step of this number in a fit: a difference in ``unit``, or a relative one if ``logarithmic``.
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
        """Return the number as the fit sees it: differences of about one are noticeable steps."""
        return float(np.log(value) if self.logarithmic else value) / self.unit_step

    def from_fit(self, coordinate: float) -> float:
        """Return the number that :meth:`to_fit` takes to ``coordinate``, brought within the bounds."""
        scaled = coordinate * self.unit_step
        value = np.exp(np.clip(scaled, -300, 300)) if self.logarithmic else scaled
        return float(np.clip(value, self.low, self.high))


@dataclass(frozen=True)
class Chain:
    """Matrices of a linear cause around the structure H: ``X = H (B F - K X)``, of which ``C X`` is measured.

    Parameters
    ----------
    response : (n, n_responses, n_responses) or None
        Matrix C from the true to the measured responses; None is the identity.
    force : (n, n_excitations, n_excitations) or None
        Matrix B from the measured to the true forces; None is the identity.
    feedback : (n, n_excitations, n_responses) or None
        Matrix K from the responses to the forces taken off, N/m; None is zero.
    """

    response: Complex | None = None
    force: Complex | None = None
    feedback: Complex | None = None


@runtime_checkable
class ChainPhysics(Protocol):
    """A linear cause with a few numbers: a measuring chain, a coupling or a mass."""

    name: str
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    confusable_with: tuple[str, ...]

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return the places where the cause may act: channel labels of the model, or one empty text."""
        ...

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent, or nearly absent."""
        ...

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        ...


@runtime_checkable
class JointPhysics(Protocol):
    """A law of one joint whose direction at the tool is unknown; the first number is an amplitude of the force."""

    name: str
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    confusable_with: tuple[str, ...]

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return the numbers from which fits start: one set a shape, each with the amplitude 1."""
        ...

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        ...


@runtime_checkable
class TwinPhysics(Protocol):
    """A joint's law that differs from another, with the same numbers, by a linear spring alone."""

    twin: str
    """Name of the other law."""


@runtime_checkable
class LimitedPhysics(Protocol):
    """A joint's law that keeps its name only within limits set by the motion; beyond them it is another law.

    Parameters
    ----------
    beyond
        Name that an answer has for the law beyond the limits.
    """

    beyond: str

    def held(self, values: Real, motion: JointMotion) -> Real:
        """Return the numbers that the law uses: the given ones, brought within the limits."""
        ...

    def strained(self, values: Real, motion: JointMotion) -> bool:
        """Tell whether the numbers lie beyond the limits, where the law has another name."""
        ...


@runtime_checkable
class BoundedPhysics(Protocol):
    """A cause whose fitted numbers may have a sign that nothing real has: it is then impossible and not reported."""

    def impossible(self, values: Real, margin: Real) -> str:
        """Say why numbers are impossible by more than their margins of error (n_parameters,); empty where possible."""
        ...


@runtime_checkable
class FaultPhysics(Protocol):
    """A fault of a recording itself: it is mended before causes are sought, and a prediction shows it again.

    Predictions show faults in the order of ``order``: a channel's limit comes after tones, as it clips them too.
    """

    order: int
    name: str
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    confusable_with: tuple[str, ...]

    def shown(self, response: Real, recording: BandRecording, start: int, term: Mapping[str, Any]) -> Real:
        """Return a predicted response (n_samples, n_responses) with the fault of a term.

        The term is ``{name, location, parameters}``; ``start`` is the first sample after the run-in.
        """
        ...


@runtime_checkable
class ModePhysics(Protocol):
    """A mode that the nominal model lacks: its numbers stand beside those of the model's own modes."""

    name: str
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    confusable_with: tuple[str, ...]

    def overdamped(self, pole: complex) -> str:
        """Why a pole, rad/s, is no mode; empty where it may be one."""
        ...

    def resolved(self, pole: complex, spacing: float, least: float) -> bool:
        """Tell whether a mode is wider than ``least`` spacings of lines, Hz; else it is a tone or chance."""
        ...


@runtime_checkable
class BeliefPhysics(Protocol):
    """Numbers of the nominal model that are farther off than a laboratory's own error."""

    name: str
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    confusable_with: tuple[str, ...]

    def odd(self, deviation: float, count: int) -> bool:
        """Tell whether ``|u|^2`` of ``count`` believed numbers is larger than errors of the usual size make it."""
        ...


Physics = ChainPhysics | JointPhysics | FaultPhysics | ModePhysics | BeliefPhysics


def answer_name(physics: Physics) -> str:
    """Return the name under which a cause is reported: its own, or that of the cause of which it is a form."""
    return str(getattr(physics, "answers_as", physics.name))


def resonance_of(squared_period: float, damping_time: float) -> dict[str, float]:
    """Return frequency (Hz) and damping ratio of ``1 + c s + T2 s^2``, c in s and T2 in s^2; empty unless T2 > 0."""
    if squared_period <= 0:
        return {}
    root = float(np.sqrt(squared_period))
    return {"resonance_hz": 1 / (2 * np.pi * root), "damping_ratio": damping_time / (2 * root)}


def axes_of(labels: tuple[str, ...]) -> list[str]:
    """Return the axis (X, Y or Z) of each degree of freedom."""
    return [DegreeOfFreedom.parse(label).axis for label in labels]


@runtime_checkable
class FormedPhysics(Protocol):
    """A linear cause whose places are forms of one law: its numbers have another meaning at each."""

    def other_forms(self, values: Real, place: str) -> tuple[tuple[str, Real], ...]:
        """Return the other places, with the numbers there that come nearest to the given ones at ``place``."""
        ...
