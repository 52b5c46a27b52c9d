"""Linear causes in the structure: modes, damping, gyroscopic coupling."""

import numpy as np

from millfrf.core import Complex, Real
from modal_fit import ModalModel

from .protocol import Chain, Parameter, axes_of


class GyroscopicCoupling:
    """The angular momentum of spindle or tool couples motions across its axis."""

    name = "gyroscopic_coupling"
    equation = "F = F_outer - [n]x X', [n]x antisymmetric"
    source = "Meirovitch, Fundamentals of Vibrations, section 4.7"
    parameters = (
        Parameter("coupling_x_ns_per_m", "N s/m", 20.0),
        Parameter("coupling_y_ns_per_m", "N s/m", 20.0),
        Parameter("coupling_z_ns_per_m", "N s/m", 20.0),
    )
    acts_on_motion = True
    confusable_with = ("modal_parameters",)

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return the columns and rows that are X, Y, Z; none without both triads."""
        return _triads(model)

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.array([0.0, 0.0, 0.0])

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        columns = [int(text) for text in place.split("|")[0].split()]
        rows = [int(text) for text in place.split("|")[1].split()]
        x, y, z = values
        cross = np.zeros((len(model.excitations), len(model.responses)))
        cross[np.ix_(columns, rows)] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        return Chain(feedback=s[:, None, None] * cross)


def _triads(model: ModalModel) -> tuple[str, ...]:
    found = []
    for labels in (model.excitations, model.responses):
        axes = axes_of(labels)
        if any(axes.count(axis) != 1 for axis in "XYZ"):
            return ()
        found.append(" ".join(str(axes.index(axis)) for axis in "XYZ"))
    return ("|".join(found),)


GYROSCOPIC_COUPLING = GyroscopicCoupling()

MOST_DAMPED = 0.3
"""Damping ratio above which a pole shapes a slope, not a peak: what asks for it is a force of another form. It is three
times the largest of a milling robot in the source papers (0.0996; Mohammadi & Ahmadi, Table 1)."""


class MissingMode:
    """A resonance that the modal test overlooked, or that a part mounted since has added."""

    name = "missing_mode"
    equation = "H += r l^T / (s - p) + conjugate"
    source = "Ewins, Modal Testing, 2nd ed., section 4.4"
    parameters: tuple[Parameter, ...] = ()
    confusable_with = ("unmeasured_excitation", "modal_parameters")

    def overdamped(self, pole: complex) -> str:
        """Why a pole is no mode; empty where it may be one.

        Parameters
        ----------
        pole : rad/s
            Fitted pole, with a positive imaginary part.

        Examples
        --------
        >>> MISSING_MODE.overdamped(-12.0 + 100.0j), MISSING_MODE.overdamped(-100.0 + 100.0j)
        ('', 'a mode damped by 71 % is no resonance')
        """
        ratio = -pole.real / abs(pole)
        return f"a mode damped by {100 * ratio:.0f} % is no resonance" if ratio > MOST_DAMPED else ""

    def resolved(self, pole: complex, spacing: float, least: float) -> bool:
        """Tell whether a mode's half-power bandwidth is wider than ``least`` times the ``spacing`` of the lines, Hz."""
        return float(-pole.real / np.pi) > least * spacing


MISSING_MODE = MissingMode()


class ModalParameters:
    """The structure has changed since its modal test, or the test was wrong.

    For errors of the usual size ``|u|^2`` of n believed numbers has the mean n and the variance 2 n; it counts as odd
    from four standard deviations above the mean.
    """

    name = "modal_parameters"
    equation = "H(u), |u|^2 > n + 4 sqrt(2 n)"
    source = "Balmes, GARTEUR group on ground vibration testing, IMAC XV, 1997 (scatter between 12 laboratories)"
    parameters: tuple[Parameter, ...] = ()
    confusable_with = ("gain_error", "axis_misalignment", "missing_mode")

    def odd(self, deviation: float, count: int) -> bool:
        """Tell whether ``|u|^2`` of ``count`` believed numbers is larger than errors of the usual size make it."""
        return bool(deviation >= count + 4 * np.sqrt(2 * count))


MODAL_PARAMETERS = ModalParameters()

PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


class NonProportionalDamping:
    """Joints or the cut damp the tool's motion by a symmetric matrix that the model's modal damping does not hold."""

    name = "non_proportional_damping"
    equation = "F = F_outer - C X', C = C^T"
    source = "Caughey & O'Kelly, J. Applied Mechanics 32, 1965; Meirovitch, Fundamentals of Vibrations, section 7.15"
    parameters = tuple(Parameter(f"damping_{'xyz'[i]}{'xyz'[j]}_ns_per_m", "N s/m", 20.0, -1e6, 1e6) for i, j in PLACES)
    acts_on_motion = True
    confusable_with = ("modal_parameters",)

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return one place if forces and responses both have X, Y and Z once."""
        return ("",) if all(sorted(axes_of(labels)) == ["X", "Y", "Z"] for labels in _sides(model)) else ()

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.zeros(len(PLACES))

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        damping = _matrix(values)
        columns, rows = (["XYZ".index(axis) for axis in axes_of(labels)] for labels in _sides(model))
        return Chain(feedback=s[:, None, None] * damping[np.ix_(columns, rows)])

    def impossible(self, values: Real, margin: Real) -> str:
        """Say why these numbers are impossible by more than their margins of error; empty where they are possible.

        A damper only takes energy: along no direction d may ``d^T C d`` be negative.
        """
        lowest, directions = np.linalg.eigh(_matrix(values))
        weights = _weights(directions[:, 0])
        if lowest[0] >= -float(np.linalg.norm(weights * margin)):
            return ""
        return (
            f"a damper that gives energy ({lowest[0]:.3g} N s/m along one direction); less damping than the model's is "
            "a matter of its modes"
        )


def _matrix(values: Real) -> Real:
    """The symmetric matrix C, (3, 3), of its six numbers."""
    damping = np.zeros((3, 3))
    for value, (i, j) in zip(values, PLACES, strict=True):
        damping[i, j] = damping[j, i] = value
    return damping


def _weights(direction: Real) -> Real:
    """Change of ``d^T C d`` with each of the six numbers, (6,)."""
    return np.array([direction[i] * direction[j] * (1 if i == j else 2) for i, j in PLACES])


def _sides(model: ModalModel) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return model.excitations, model.responses


NON_PROPORTIONAL_DAMPING = NonProportionalDamping()
