"""Receptance of a robot in one posture, and its derivatives over free parameters and over errors of the modes."""

from collections.abc import Sequence

import numpy as np
import scipy

from millfrf.core import Complex, Real

from ..settings import UPDATE
from .changed_structure import UpdateParameter, of_kind, payload_place, sprung_mass, value_of
from .matrices import PostureSystem, mass_block


class PostureResponse:
    """Receptance at differences x of the free parameters, with derivatives; both share the modes at x.

    ``H = P (Lambda - w^2 + i w C)^-1 P^T`` and ``dH = -X^T (dK - w^2 dM + i w dC) X`` with ``X = D^-1 P^T``. The
    frequencies (n_lines,), Hz, must rise; ``rows`` and ``columns`` are the indices of responses and excitations in
    (TIP, HOUSING). Differences that leave no positive mass raise LinAlgError.
    """

    def __init__(
        self,
        system: PostureSystem,
        parameters: Sequence[UpdateParameter],
        x: Real,
        frequencies: Real,
        rows: tuple[int, ...],
        columns: tuple[int, ...],
    ):
        self.system, self.parameters, self.x = system, parameters, np.asarray(x, dtype=float)
        self.rows, self.columns = list(rows), list(columns)
        self.omega = 2 * np.pi * np.asarray(frequencies, dtype=float)
        self.squares, shapes = scipy.linalg.eigh(*_assembled(system, parameters, self.x))
        self.natural = np.sqrt(np.maximum(self.squares, 0.0))
        self.shapes = system.observed @ shapes
        self.factors = [None if factor is None else factor @ shapes for factor in system.factors]
        # damping couples modes up to four times the band; the coupling of higher modes is neglected
        self.low = np.abs(self.squares) < (4.0 * self.omega[-1]) ** 2
        self.damping_factor = float(np.exp(self._value("damping")))
        self.modal_damping = self._modal_damping()
        self.damping = self._damping()
        self.solved = self._solutions()

    def receptance(self) -> Complex:
        """Compute the receptance, m/N, (n_lines, n_responses, n_excitations).

        A compliant tool has the compliance C between spindle and tip, and the tool's mass m moves from the spindle to
        the tip. With A the receptance for a rigid tool, ``A' = A (I + w^2 m A)^-1`` is the spindle without that mass,
        ``B = A' + C`` and ``H = B (I - w^2 m B)^-1``.
        """
        return self._with_tool() if self._tool_compliances().any() else self._between(self.rows, self.columns)

    def slopes(self) -> Complex:
        """Compute derivatives over the free parameters, (n_parameters, n_lines, n_responses, n_excitations)."""
        return np.stack([self._slope(i) for i in range(len(self.parameters))])

    def mode_derivatives(self) -> tuple[Complex, Real]:
        """Compute derivatives over n errors of the modes near the band, (n, n_lines, n_responses, n_excitations).

        For each mode the errors are of the relative frequency, the relative damping and the components of the shape.
        Also return the expected sizes (n,) of the errors over the expected error of the relative frequency.
        """
        near = np.flatnonzero((self.squares > 0) & (self.natural < 1.3 * self.omega[-1]))
        values, sizes = [], []
        omega = self.omega[:, None, None]
        used = sorted({*self.rows, *self.columns})
        for mode in near:
            a, b = self.solved[:, mode, self.rows], self.solved[:, mode, self.columns]
            product = a[:, :, None] * b[:, None, :]
            values += [-2 * self.squares[mode] * product, -1j * omega * self.damping[mode, mode] * product]
            # a model right to 1 % in frequency is expected right to 10 % in damping and 5 % in shapes
            sizes += [1.0, 10.0, *[5.0] * len(used)]
            size = float(np.sqrt(np.mean(self.shapes[used, mode] ** 2)))
            for label in used:
                change = np.zeros_like(product)
                change[:, [row == label for row in self.rows]] += size * b[:, None, :]
                change[:, :, [column == label for column in self.columns]] += size * a[:, :, None]
                values.append(change)
        shape = (0, len(self.omega), len(self.rows), len(self.columns))
        return np.stack(values) if values else np.zeros(shape, dtype=complex), np.array(sizes)

    def _value(self, kind: str, axis: int = 0) -> float:
        return value_of(self.parameters, self.x, kind, axis)

    def _modal_damping(self) -> Real:
        """Compute the damping of each mode without the joints' dampers, ``2 zeta w``, rad/s, (n,)."""
        if self.system.ratio is not None:
            damping = 2 * self.damping_factor * self.system.ratio * self.natural
        else:
            a, b = self.system.rayleigh
            damping = self.damping_factor * (a + b * self.squares)
        return np.where(self.squares > 0, damping, 0.0)

    def _damping(self) -> Real:
        """Compute the damping over all modes, (n, n), with the dampers of joints, which couple modes."""
        damping = np.diag(self.modal_damping)
        for i, parameter in enumerate(self.parameters):
            if parameter.kind == "joint damping":
                rows = self.factors[i]
                assert rows is not None
                size = self.system.own_damping[i] + self.x[i] * self.system.damping_units[i]
                damping += size * rows.T @ rows
        return damping

    def _solutions(self) -> Complex:
        """Solve ``D X = P^T`` for the motion X of the modes per unit force, (n_lines, n, n_labels)."""
        omega = self.omega[:, None]
        gain = 1 / (self.squares - omega**2 + 1j * omega * np.diag(self.damping))
        solved = gain[:, :, None] * self.shapes.T
        low = np.flatnonzero(self.low)
        if len(low) and any(parameter.kind == "joint damping" for parameter in self.parameters):
            damping = self.damping[np.ix_(low, low)]
            matrix = 1j * omega[:, :, None] * damping + np.eye(len(low)) * (self.squares[low] - omega**2)[:, None, :]
            solved[:, low] = np.linalg.solve(matrix, self.shapes[:, low].T.astype(complex)[None])
        return np.asarray(solved)

    def _between(self, rows: list[int], columns: list[int]) -> Complex:
        """Compute the receptance between rows and columns as if the tool were rigid."""
        return np.asarray(self.shapes[rows] @ self.solved[:, :, columns])

    def _tool_compliances(self) -> Real:
        lateral, axial = (self._value("tool", axis) for axis in (0, 1))
        return np.array([lateral, lateral, axial])

    def _with_tool(self, further_mass: float = 0.0) -> Complex:
        moved, loaded = self._parts_with_tool(further_mass)
        return np.asarray((moved @ loaded)[:, self.rows][:, :, self.columns])

    def _parts_with_tool(self, further_mass: float = 0.0) -> tuple[Complex, Complex]:
        """Compute motion of tip and housing per force in the tool's spring, and this force per force at the tip."""
        square = self._inertia_of_tool(further_mass)
        moved = self._between(list(range(6)), [0, 1, 2])
        moved = moved @ np.linalg.inv(np.eye(3) + square * moved[:, :3])
        moved[:, :3] += self._along_channels(self._tool_compliances())
        return moved, np.asarray(np.linalg.inv(np.eye(3) - square * moved[:, :3]))

    def _inertia_of_tool(self, further_mass: float = 0.0) -> Real:
        """Compute ``w^2 m`` with the mass m on the tool's spring, (n_lines, 1, 1)."""
        return (self.omega**2 * sprung_mass(self._value("sprung mass") + further_mass))[:, None, None]

    def _along_channels(self, compliance: Real) -> Real:
        """Transform compliances (3,) across and along the tool into the channels' axes, (3, 3)."""
        return np.asarray((self.system.tool * compliance) @ self.system.tool.T)

    def _slope(self, i: int) -> Complex:
        parameter = self.parameters[i]
        if parameter.kind == "tool":
            return self._tool_slope(parameter.axis)[:, self.rows][:, :, self.columns]
        if parameter.kind == "sprung mass":
            return self._sprung_slope()
        left, right = self.solved[:, :, self.rows], self.solved[:, :, self.columns]
        if parameter.kind == "damping":
            return np.asarray(-1j * self.omega[:, None, None] * _quadratic(left, np.diag(self.modal_damping), right))
        factor = self.factors[i]
        assert factor is not None
        a, b = factor @ left, factor @ right
        if parameter.kind == "joint damping":
            return np.asarray(-1j * self.omega[:, None, None] * self.system.damping_units[i] * _product(a, b))
        if parameter.kind in ("payload", "tool mass", "body", "inertia"):
            block = self._mass_slope(i)
            change = factor.T @ block @ factor
            direct = (self.omega**2)[:, None, None] * _product(a, block @ b)
            return np.asarray(direct - self._damping_change(np.zeros_like(change), change, left, right))
        weight = float(np.exp(self.x[i])) if parameter.kind != "base" else -1 / _compliance(self.x[i]) ** 2
        change = weight * factor.T @ factor
        return np.asarray(-weight * _product(a, b) - self._damping_change(change, np.zeros_like(change), left, right))

    def _tool_slope(self, axis: int) -> Complex:
        unit = self._along_channels(np.array([1.0, 1.0, 0.0]) if axis == 0 else np.array([0.0, 0.0, 1.0]))
        moved, loaded = self._parts_with_tool()
        change = moved @ loaded @ (self._inertia_of_tool() * unit) @ loaded
        change[:, :3] += unit @ loaded
        return np.asarray(change)

    def _sprung_slope(self) -> Complex:
        """Compute the derivative over the mass on the tool's spring by a forward difference."""
        if not self._tool_compliances().any():
            return np.zeros((len(self.omega), len(self.rows), len(self.columns)), dtype=complex)
        step = 1e-4  # kg
        return np.asarray((self._with_tool(step) - self._with_tool()) / step)

    def _mass_slope(self, i: int) -> Real:
        """Compute the derivative of a node's mass matrix (6, 6) over one parameter."""
        parameter = self.parameters[i]
        if parameter.kind in ("body", "inertia"):
            return np.asarray(np.exp(self.x[i]) * self.system.blocks[i])
        if parameter.kind == "tool mass":
            return mass_block(1.0, self.system.tool_arm)
        mass, place = _payload(self.system, self.parameters, self.x)
        axes = self.system.base_axes
        if parameter.axis == 3:
            return mass_block(1.0, axes @ place)
        step = 1e-4 * np.eye(3)[parameter.axis]  # m
        return (mass_block(mass, axes @ (place + step)) - mass_block(mass, axes @ (place - step))) / 2e-4

    def _damping_change(self, stiffness: Real, mass: Real, left: Complex, right: Complex) -> Complex:
        """Compute ``i w X^T dC X``, with the change dC of the damping that a change of stiffness and mass causes.

        One damping ratio means ``C = 2 zeta M (M^-1 K)^(1/2)``, so that
        ``dC_rs = 2 zeta (k + m w_r w_s) / (w_r + w_s)``.
        """
        low = np.flatnonzero(self.low & (self.squares > 0))
        k, m = stiffness[np.ix_(low, low)], mass[np.ix_(low, low)]
        if self.system.ratio is not None:
            natural = self.natural[low]
            sums = natural[:, None] + natural
            change = 2 * self.damping_factor * self.system.ratio * (k + m * np.outer(natural, natural)) / sums
        else:
            a, b = self.system.rayleigh
            change = self.damping_factor * (a * m + b * k)
        return np.asarray(1j * self.omega[:, None, None] * _quadratic(left[:, low], change, right[:, low]))


def _assembled(system: PostureSystem, parameters: Sequence[UpdateParameter], x: Real) -> tuple[Real, Real]:
    """Assemble stiffness and mass at the differences x, each (n, n)."""
    stiffness, mass = system.stiffness.copy(), system.mass.copy()
    for i, (parameter, value, factor) in enumerate(zip(parameters, x, system.factors, strict=True)):
        if factor is None:
            continue
        if parameter.kind in ("body", "inertia"):
            mass += np.expm1(value) * factor.T @ system.blocks[i] @ factor
        if parameter.kind in ("stiffness", "links"):
            stiffness += np.exp(value) * factor.T @ factor
        elif parameter.kind == "base":
            stiffness += factor.T @ factor / _compliance(value)
        elif parameter.kind == "tool mass":
            mass += factor.T @ mass_block(value, system.tool_arm) @ factor
        elif parameter.kind == "payload" and parameter.axis == 3:
            kilograms, place = _payload(system, parameters, x)
            mass += factor.T @ mass_block(kilograms, system.base_axes @ place) @ factor
    if np.linalg.eigvalsh(mass)[0] <= 0:
        raise scipy.linalg.LinAlgError("no positive mass")
    return stiffness, mass


def _compliance(value: float) -> float:
    """Limit the size of a base compliance from below; keep its sign."""
    return value if abs(value) > UPDATE.least_compliance else UPDATE.least_compliance


def _payload(system: PostureSystem, parameters: Sequence[UpdateParameter], x: Real) -> tuple[float, Real]:
    """Return the mass of the payload, kg, and its place from the node that carries it, tool frame, m."""
    payload = of_kind(parameters, x, "payload")
    return payload.get(3, 0.0), payload_place(payload) - system.arms[0]


def _product(a: Complex, b: Complex) -> Complex:
    return np.asarray(a.transpose(0, 2, 1) @ b)


def _quadratic(left: Complex, matrix: Real, right: Complex) -> Complex:
    return np.asarray(left.transpose(0, 2, 1) @ (matrix @ right))
