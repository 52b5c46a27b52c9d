"""What a hypothesis about left-out physics has to say: the protocols behind every file of this folder."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from estimation import BandRecording
from foundation import DegreeOfFreedom
from modal_fit import ModalModel

from ..joints import JointLaw, JointMotion

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


DRY = 0.1
"""Of the typical deflection or velocity: what gives way within less is dry friction; an element that yields later is
hysteresis, and a force that still rises with the speed beyond it is damping of another kind."""


@dataclass(frozen=True)
class Parameter:
    """One number of a hypothesis.

    Parameters
    ----------
    name
        With its unit as a suffix, as it stands in files: ``delay_s``.
    unit
        SI.
    unit_step
        What counts as a step of this number in a fit: a plain difference, or a relative one if ``logarithmic``.
    low, high
        Bounds.
    logarithmic
        The number is positive and its logarithm is fitted.
    """

    name: str
    unit: str
    unit_step: float
    low: float = -np.inf
    high: float = np.inf
    logarithmic: bool = False

    def to_fit(self, value: float) -> float:
        """The number as the fit sees it: differences of about one are noticeable steps."""
        return float(np.log(value) if self.logarithmic else value) / self.unit_step

    def from_fit(self, coordinate: float) -> float:
        """Back from :meth:`to_fit`, brought within the bounds."""
        scaled = coordinate * self.unit_step
        value = np.exp(np.clip(scaled, -300, 300)) if self.logarithmic else scaled
        return float(np.clip(value, self.low, self.high))


@dataclass(frozen=True)
class Chain:
    """How a linear cause stands around the structure: ``X = H (B F - K X)``, measured ``C X``; None is the identity.

    Parameters
    ----------
    response : (n, n_responses, n_responses) or None
        C.
    force : (n, n_excitations, n_excitations) or None
        B.
    feedback : (n, n_excitations, n_responses) or None
        K; None is zero.
    """

    response: Complex | None = None
    force: Complex | None = None
    feedback: Complex | None = None


@runtime_checkable
class ChainPhysics(Protocol):
    """A linear cause of few numbers: measuring chain, coupling, mass."""

    name: str
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    confusable_with: tuple[str, ...]

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Where it may act: channel labels of the model, or one empty text."""
        ...

    def start(self, model: ModalModel) -> Real:
        """The numbers at which the cause is absent, or all but."""
        ...

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Its matrices at ``s`` (n,), rad/s."""
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
        """Shapes to try, the amplitude 1."""
        ...

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """The joint's force law."""
        ...


@runtime_checkable
class LimitedPhysics(Protocol):
    """A joint's law whose name holds only within limits that the motion sets; beyond them it is another law."""

    def held(self, values: Real, motion: JointMotion) -> Real:
        """The numbers that the law goes by: those given, brought within the limits."""
        ...

    def strained(self, values: Real, motion: JointMotion) -> bool:
        """Whether the numbers ask for what the name excludes."""
        ...


@runtime_checkable
class BoundedPhysics(Protocol):
    """A cause whose numbers may have a sign that nothing real has: it is then said to be impossible, and not told."""

    def impossible(self, values: Real, margin: Real) -> str:
        """Why numbers cannot be, beyond a margin (n_parameters,) for their errors; empty where they can."""
        ...


@runtime_checkable
class FaultPhysics(Protocol):
    """A fault of a recording itself: it is mended there before causes are looked for, and shown in a prediction.

    Faults are shown in the order of their number ``order``: a limit holds for whatever a channel shows, tones too.
    """

    order: int
    name: str
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    confusable_with: tuple[str, ...]

    def shown(self, response: Real, recording: BandRecording, start: int, term: Mapping[str, Any]) -> Real:
        """A predicted response (n_samples, n_responses) with the fault of a term ``{name, location, parameters}``.

        ``start`` is the first sample after the run-in.
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

    def resolved(self, pole: complex, spacing: float, least: float) -> bool:
        """Whether a mode is wider than ``least`` spacings of lines (Hz): else it is a tone, or an accident."""
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
        """Whether ``|u|^2`` of that many believed numbers is larger than errors of the usual size make it."""
        ...


Physics = ChainPhysics | JointPhysics | FaultPhysics | ModePhysics | BeliefPhysics


def answer_name(physics: Physics) -> str:
    """Name under which a cause is reported: its own, or that of the cause it is a form of (``answers_as``)."""
    return str(getattr(physics, "answers_as", physics.name))


def resonance_of(squared_period: float, damping_time: float) -> dict[str, float]:
    """Frequency and damping ratio of ``1 + c s + T2 s^2``, c in s and T2 in s^2; nothing where T2 is none."""
    if squared_period <= 0:
        return {}
    root = float(np.sqrt(squared_period))
    return {"resonance_hz": 1 / (2 * np.pi * root), "damping_ratio": damping_time / (2 * root)}


def axes_of(labels: tuple[str, ...]) -> list[str]:
    """Axis (X, Y or Z) of each degree of freedom."""
    return [DegreeOfFreedom.parse(label).axis for label in labels]


@runtime_checkable
class FormedPhysics(Protocol):
    """A linear cause whose places are forms of one law, so that its numbers mean another thing at each."""

    def other_forms(self, values: Real, place: str) -> tuple[tuple[str, Real], ...]:
        """Other places, with the numbers there that come nearest to the given ones here."""
        ...
