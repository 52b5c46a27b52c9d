"""Structures, cuts and converged limits that several tests check against."""

from collections.abc import Sequence

import numpy as np

from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

Mode = tuple[float, float, float, tuple[float, float, float]]
"""Natural frequency (Hz), damping ratio, modal stiffness (N/m) and direction in X, Y, Z."""

RPM = 2 * np.pi / 60
SPEEDS_RPM = np.array([6000, 8000, 10000, 15000, 20000, 25000.0])
# lowest unstable depth in mm of the 1-degree-of-freedom benchmark (922 Hz, zeta .011, .03993 kg, Kt 6e8, Kn 2e8 N/m^2,
# N = 2), from an independent collocation split at entry and exit, converged to 5 digits
CONVERGED_MM: dict[tuple[float, str], list[float]] = {
    (1.0, "slot"): [0.35322, 0.67639, 0.32238, 0.38659, 1.41751, 3.93993],
    (0.5, "down"): [1.13885, 0.79793, 2.10469, 2.59624, 0.71964, 1.03770],
    (0.5, "up"): [0.22789, 0.40604, 0.21353, 0.25887, 1.18530, 3.93172],
    (0.1, "down"): [1.73292, 1.22042, 2.51841, 4.34368, 1.22147, 1.62880],
    (0.1, "up"): [0.89250, 1.68400, 0.81534, 0.96596, 2.20603, np.inf],
    (0.05, "down"): [3.07133, 2.16316, 4.09071, 8.21248, 2.29868, 2.91172],
    (0.05, "up"): [1.83173, 3.49558, 1.65770, 1.88796, 3.77405, np.inf],
}


def oscillators(modes: Sequence[Mode]) -> ModalModel:
    """Modes that each move the tool along one line."""
    turn, zeta, stiffness = (np.array(column) for column in zip(*(mode[:3] for mode in modes), strict=True))
    omega = 2 * np.pi * turn
    damped, shapes = omega * np.sqrt(1 - zeta**2), np.array([mode[3] for mode in modes], np.complex128)
    points = ("TCP:+X", "TCP:+Y", "TCP:+Z")
    right = shapes * (omega**2 / stiffness / (2j * damped))[:, None]
    return ModalModel(-zeta * omega + 1j * damped, right, shapes, points, points)


def one_degree_of_freedom() -> ModalModel:
    """The structure of that benchmark, flexible in X (the feed)."""
    turn, zeta, mass = 2 * np.pi * 922, 0.011, 0.03993
    pole = turn * (-zeta + 1j * np.sqrt(1 - zeta**2))
    right = np.array([[1 / (mass * 2j * pole.imag)]])
    return ModalModel(np.array([pole]), right, np.ones((1, 1)) + 0j, ("TCP:+X",), ("TCP:+X",))


def benchmark_cut(immersion: float, side: str) -> MillingProcess:
    """Its cut: radial immersion a/D, ``up``, ``down`` or ``slot``."""
    width = np.arccos(1 - 2 * immersion)
    start, leave = {"slot": (0.0, np.pi), "up": (0.0, width), "down": (np.pi - width, np.pi)}[side]
    return MillingProcess(2, 0.01, np.pi / 2, 6e8, 1 / 3, 0.0, start, leave, 0.1e-3)


HALF_DOWN = MillingProcess(2, 0.0127, np.pi / 2, 119e6, 0.17, 0.33, np.pi / 2, np.pi, 0.15e-3)
"""Half-immersion down-milling of Mohammadi & Ahmadi with their cutter and acetal."""
