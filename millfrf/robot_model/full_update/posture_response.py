"""Response of a robot in one posture, and its derivatives over freed numbers and over what modes may be off."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Complex, Real

from .changed_structure import LEAST_COMPLIANCE, UpdateParameter, sprung_mass
from .matrices import PostureSystem, mass_block

STEP = 1e-4
"""Step of a difference over the mass on the tool's spring, kg."""

COUPLED = 4.0
"""Modes up to so many times the band are coupled by damping; higher ones have their own share of it."""


@dataclass(frozen=True)
class Answer:
    """Response of a posture with its derivatives.

    Parameters
    ----------
    values : (n_lines, n_responses, n_excitations), m/N
        Receptance that the robot gives in this posture.
    slopes : (n_parameters, n_lines, n_responses, n_excitations)
        Its derivatives over the freed numbers.
    mode_slopes : (n_numbers, n_lines, n_responses, n_excitations)
        Its derivatives over relative frequency, relative damping and shapes of each mode near the band, in turn.
    mode_sizes : (n_numbers,)
        By how much each of them may be off, in units of the relative frequency: 1, 10 or 5.
    frequencies : (n_modes,), Hz
        Natural frequencies of these modes.
    """

    values: Complex
    slopes: Complex
    mode_slopes: Complex
    mode_sizes: Real
    frequencies: Real


FREQUENCY_SIZE, DAMPING_SIZE, SHAPE_SIZE = 1.0, 10.0, 5.0
"""How much a right model's damping and shapes are off for each percent of frequency."""


def answer(
    system: PostureSystem,
    parameters: Sequence[UpdateParameter],
    x: Real,
    frequencies: Real,
    rows: tuple[int, ...],
    columns: tuple[int, ...],
) -> Answer:
    """Compute a posture's receptance at differences x, with derivatives.

    ``H = P (Lambda - w^2 + i w C)^-1 P^T`` and ``dH = -X^T (dK - w^2 dM + i w dC) X`` with ``X = D^-1 P^T``.

    Parameters
    ----------
    x : (n_parameters,)
        Differences of the freed numbers.
    frequencies : (n_lines,), Hz
        Frequencies of the lines, rising.
    rows, columns
        Places of responses and excitations in the system's labels.

    Raises
    ------
    LinAlgError
        Numbers that leave no positive mass.
    """
    known = _Known(system, parameters, np.asarray(x, dtype=float), np.asarray(frequencies, dtype=float))
    values = known.with_tool(rows, columns)
    slopes = np.stack([known.slope(i, rows, columns) for i in range(len(parameters))])
    modes, sizes, natural = known.mode_slopes(rows, columns)
    return Answer(values, slopes, modes, sizes, natural)


def receptance_of(
    system: PostureSystem,
    parameters: Sequence[UpdateParameter],
    x: Real,
    frequencies: Real,
    rows: tuple[int, ...],
    columns: tuple[int, ...],
) -> Complex:
    """The receptance alone, m/N, (n_lines, n_responses, n_excitations)."""
    known = _Known(system, parameters, np.asarray(x, dtype=float), np.asarray(frequencies, dtype=float))
    return known.with_tool(rows, columns)


class _Known:
    """Modes, damping and solutions at one x, shared by response and derivatives."""

    def __init__(self, system: PostureSystem, parameters: Sequence[UpdateParameter], x: Real, frequencies: Real):
        self.system, self.parameters, self.x = system, parameters, x
        self.omega = 2 * np.pi * frequencies
        stiffness, mass = _assembled(system, parameters, x)
        squares, shapes = scipy.linalg.eigh(stiffness, mass)
        self.squares = squares
        self.natural = np.sqrt(np.maximum(squares, 0.0))
        self.rows = system.observed @ shapes
        self.factors = [None if factor is None else factor @ shapes for factor in system.factors]
        self.low = np.abs(squares) < (COUPLED * self.omega[-1]) ** 2
        self.damping = self._damping()
        self.solved = self._solutions()

    def _damping(self) -> Real:
        """Damping over all modes, (n, n)."""
        factor = float(np.exp(_value(self.parameters, self.x, "damping")))
        if self.system.ratio is not None:
            base = 2 * factor * self.system.ratio * self.natural
        else:
            a, b = self.system.rayleigh
            base = factor * (a + b * self.squares)
        self.base = np.where(self.squares > 0, base, 0.0)
        whole = np.diag(self.base)
        for i, one in enumerate(self.parameters):
            if one.kind == "joint damping":
                rows = self.factors[i]
                assert rows is not None
                size = self.system.own_damping[i] + self.x[i] * self.system.damping_units[i]
                whole += size * rows.T @ rows
        return whole

    def _solutions(self) -> Complex:
        """``X = D^-1 P^T``, (n_lines, n, n_labels)."""
        omega = self.omega[:, None]
        gain = 1 / (self.squares - omega**2 + 1j * omega * np.diag(self.damping))
        solved = gain[:, :, None] * self.rows.T
        low = np.flatnonzero(self.low)
        if len(low) and any(one.kind == "joint damping" for one in self.parameters):
            part = self.damping[np.ix_(low, low)]
            matrix = 1j * omega[:, :, None] * part + np.eye(len(low)) * (self.squares[low] - omega**2)[:, None, :]
            solved[:, low] = np.linalg.solve(matrix, self.rows[:, low].T.astype(complex)[None])
        return np.asarray(solved)

    def observed_over(self, rows: tuple[int, ...], columns: tuple[int, ...]) -> Complex:
        """Receptance without the tool's compliance."""
        return np.asarray(self.rows[list(rows)] @ self.solved[:, :, list(columns)])

    def with_tool(self, rows: tuple[int, ...], columns: tuple[int, ...]) -> Complex:
        """Receptance with a tool that gives way by C between spindle and tip, and its mass m moved onto that spring.

        ``A' = A (I + w^2 m A)^-1`` is the spindle without that mass, ``B = A' + C``, ``H = B (I - w^2 m B)^-1``.
        """
        lateral, axial = (_value(self.parameters, self.x, "tool", axis) for axis in (0, 1))
        if not (lateral or axial):
            return self.observed_over(rows, columns)
        moved, loaded = self._parts_with_tool()
        return np.asarray((moved @ loaded)[:, list(rows)][:, :, list(columns)])

    def _parts_with_tool(self) -> tuple[Complex, Complex]:
        """Motion of tip and housing per force in the tool's spring, and that force per force at the tip."""
        lateral, axial = (_value(self.parameters, self.x, "tool", axis) for axis in (0, 1))
        compliance = self._tool(np.array([lateral, lateral, axial]))
        square = (self.omega**2 * self._sprung_mass())[:, None, None]
        moved = self.observed_over(tuple(range(6)), (0, 1, 2))
        moved = moved @ np.linalg.inv(np.eye(3) + square * moved[:, :3])
        moved[:, :3] += compliance
        return moved, np.asarray(np.linalg.inv(np.eye(3) - square * moved[:, :3]))

    def _sprung_mass(self) -> float:
        return sprung_mass(_value(self.parameters, self.x, "sprung mass"))

    def _tool(self, compliance: Real) -> Real:
        """Compliance across and along the tool in the channels' axes, (3, 3)."""
        return np.asarray((self.system.tool * compliance) @ self.system.tool.T)

    def _tool_slope(self, axis: int) -> Complex:
        unit = self._tool(np.array([1.0, 1.0, 0.0]) if axis == 0 else np.array([0.0, 0.0, 1.0]))
        moved, loaded = self._parts_with_tool()
        change = moved @ loaded @ ((self.omega**2 * self._sprung_mass())[:, None, None] * unit) @ loaded
        change[:, :3] += unit @ loaded
        return np.asarray(change)

    def slope(self, i: int, rows: tuple[int, ...], columns: tuple[int, ...]) -> Complex:
        """Derivative over one freed number."""
        one, size = self.parameters[i], (len(self.omega), len(rows), len(columns))
        if one.kind == "tool":
            return self._tool_slope(one.axis)[:, list(rows)][:, :, list(columns)]
        if one.kind == "sprung mass":
            return self._sprung_slope(rows, columns, size)
        left, right = self.solved[:, :, list(rows)], self.solved[:, :, list(columns)]
        if one.kind == "damping":
            return np.asarray(-1j * self.omega[:, None, None] * _quadratic(left, np.diag(self.base), right))
        factor = self.factors[i]
        assert factor is not None
        a, b = factor @ left, factor @ right
        if one.kind == "joint damping":
            return np.asarray(-1j * self.omega[:, None, None] * self.system.damping_units[i] * _outer(a, b))
        if one.kind in ("payload", "tool mass", "body", "inertia"):
            block = self._mass_slope(i)
            change = factor.T @ block @ factor
            direct = (self.omega**2)[:, None, None] * _outer(a, block @ b)
            return np.asarray(direct - self._damping_change(np.zeros_like(change), change, left, right))
        weight = self._stiffness_slope(i)
        change = weight * factor.T @ factor
        return np.asarray(-weight * _outer(a, b) - self._damping_change(change, np.zeros_like(change), left, right))

    def _sprung_slope(self, rows: tuple[int, ...], columns: tuple[int, ...], size: tuple[int, int, int]) -> Complex:
        """Derivative over the mass that moves on the tool's spring instead of with the spindle."""
        if not any(_value(self.parameters, self.x, "tool", axis) for axis in (0, 1)):
            return np.zeros(size, dtype=complex)
        place, before = self._place_of("sprung mass"), self.with_tool(rows, columns)
        own = self.x[place]
        self.x = self.x + STEP * np.eye(len(self.x))[place]
        after = self.with_tool(rows, columns)
        self.x = self.x - (self.x[place] - own) * np.eye(len(self.x))[place]
        return np.asarray((after - before) / STEP)

    def _place_of(self, kind: str) -> int:
        return next(i for i, one in enumerate(self.parameters) if one.kind == kind)

    def _stiffness_slope(self, i: int) -> float:
        one, value = self.parameters[i], self.x[i]
        if one.kind == "base":
            return -1 / _compliance(value) ** 2
        return float(np.exp(value))

    def _mass_slope(self, i: int) -> Real:
        one = self.parameters[i]
        if one.kind in ("body", "inertia"):
            return np.asarray(np.exp(self.x[i]) * self.system.blocks[i])
        if one.kind == "tool mass":
            return mass_block(1.0, self.system.tool_arm)
        mass, place = _payload(self.system, self.parameters, self.x)
        axes = self.system.base_axes
        if one.axis == 3:
            return mass_block(1.0, axes @ place)
        step = 1e-4 * np.eye(3)[one.axis]
        return (mass_block(mass, axes @ (place + step)) - mass_block(mass, axes @ (place - step))) / 2e-4

    def _damping_change(self, stiffness: Real, mass: Real, left: Complex, right: Complex) -> Complex:
        """``i w X^T dC X`` where the robot's own damping follows stiffness and mass.

        One ratio: ``C = 2 zeta M (M^-1 K)^(1/2)``, so ``dC_rs = 2 zeta (k + m w_r w_s) / (w_r + w_s)``.
        """
        factor = float(np.exp(_value(self.parameters, self.x, "damping")))
        low = np.flatnonzero(self.low & (self.squares > 0))
        k, m = stiffness[np.ix_(low, low)], mass[np.ix_(low, low)]
        if self.system.ratio is not None:
            natural = self.natural[low]
            both = natural[:, None] + natural
            change = 2 * factor * self.system.ratio * (k + m * np.outer(natural, natural)) / both
        else:
            a, b = self.system.rayleigh
            change = factor * (a * m + b * k)
        return np.asarray(1j * self.omega[:, None, None] * _quadratic(left[:, low], change, right[:, low]))

    def mode_slopes(self, rows: tuple[int, ...], columns: tuple[int, ...]) -> tuple[Complex, Real, Real]:
        """Derivatives over what a right model's modes may be off."""
        near = np.flatnonzero((self.squares > 0) & (self.natural < 1.3 * self.omega[-1]))
        slopes, sizes = [], []
        omega = self.omega[:, None, None]
        for mode in near:
            a, b = self.solved[:, mode, list(rows)], self.solved[:, mode, list(columns)]
            both = a[:, :, None] * b[:, None, :]
            slopes += [-2 * self.squares[mode] * both, -1j * omega * self.damping[mode, mode] * both]
            sizes += [FREQUENCY_SIZE, DAMPING_SIZE]
            shape = self.rows[:, mode]
            used = sorted({*rows, *columns})
            size = float(np.sqrt(np.mean(shape[used] ** 2)))
            for label in used:
                part = np.zeros_like(both)
                for p, row in enumerate(rows):
                    if row == label:
                        part[:, p] += size * b
                for c, column in enumerate(columns):
                    if column == label:
                        part[:, :, c] += size * a
                slopes.append(part)
                sizes.append(SHAPE_SIZE)
        shape_of = (0, len(self.omega), len(rows), len(columns))
        stacked = np.stack(slopes) if slopes else np.zeros(shape_of, dtype=complex)
        return stacked, np.array(sizes), self.natural[near] / (2 * np.pi)


def _assembled(system: PostureSystem, parameters: Sequence[UpdateParameter], x: Real) -> tuple[Real, Real]:
    stiffness, mass = system.stiffness.copy(), system.mass.copy()
    for i, (one, value, factor) in enumerate(zip(parameters, x, system.factors, strict=True)):
        if factor is None:
            continue
        if one.kind in ("body", "inertia"):
            mass += np.expm1(value) * factor.T @ system.blocks[i] @ factor
        if one.kind in ("stiffness", "links"):
            stiffness += np.exp(value) * factor.T @ factor
        elif one.kind == "base":
            stiffness += factor.T @ factor / _compliance(value)
        elif one.kind == "tool mass":
            mass += factor.T @ mass_block(value, system.tool_arm) @ factor
        elif one.kind == "payload" and one.axis == 3:
            kilograms, place = _payload(system, parameters, x)
            mass += factor.T @ mass_block(kilograms, system.base_axes @ place) @ factor
    if np.linalg.eigvalsh(mass)[0] <= 0:
        raise scipy.linalg.LinAlgError("no positive mass")
    return stiffness, mass


def _compliance(value: float) -> float:
    """A base's compliance, kept away from zero; its sign stays."""
    return value if abs(value) > LEAST_COMPLIANCE else LEAST_COMPLIANCE


def _payload(system: PostureSystem, parameters: Sequence[UpdateParameter], x: Real) -> tuple[float, Real]:
    found = {one.axis: float(value) for one, value in zip(parameters, x, strict=True) if one.kind == "payload"}
    return found.get(3, 0.0), np.array([found.get(axis, 0.0) for axis in range(3)]) + system.centre - system.arms[0]


def _value(parameters: Sequence[UpdateParameter], x: Real, kind: str, axis: int = 0) -> float:
    found = (value for one, value in zip(parameters, x, strict=True) if one.kind == kind and one.axis == axis)
    return float(next(found, 0.0))


def _outer(a: Complex, b: Complex) -> Complex:
    return np.asarray(a.transpose(0, 2, 1) @ b)


def _quadratic(left: Complex, matrix: Real, right: Complex) -> Complex:
    return np.asarray(left.transpose(0, 2, 1) @ (matrix @ right))
