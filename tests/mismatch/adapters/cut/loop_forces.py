"""Forces of a rigid cutter in time, by loops over teeth, slices and samples: shares no code with the package."""

import numpy as np
from numpy.typing import NDArray

RATE = 10_000.0
COEFFICIENTS = np.array([900e6, 300e6, 150e6, 16e3, 19e3, 5e3])  # Ktc, Krc, Kac, Pa; Kte, Kre, Kae, N/m


def loop_forces(
    feed: float,
    *,
    teeth: int = 2,
    helix: float = 0.5,
    depth: float = 0.003,
    diameter: float = 0.016,
    immersion: tuple[float, float] = (0.0, np.pi),
    runout: float = 12e-6,
    runout_angle: float = 1.0,
    rpm: float = 6018.0,
    last_rpm: float | None = None,
    seconds: float = 1.2,
    first_angle: float = 0.3,
    noise: float = 0.02,
    seed: int = 1,
    coefficients: NDArray[np.float64] = COEFFICIENTS,
    powers: tuple[float, float, float] = (0.0, 0.0, 0.0),
    round_edge: float = 0.0,
) -> NDArray[np.float64]:
    """Return the force on the tool (n, 3), N, at one speed or in a sweep; noise as a share of the largest force.

    With ``powers`` m the force of a chip h is ``K h (h / 1 mm)^-m``; below ``round_edge`` (m) it follows the tangent.
    """
    time = np.arange(int(seconds * RATE)) / RATE
    change = 0.0 if last_rpm is None else (last_rpm - rpm) / seconds
    angle = (rpm * time + change * time**2 / 2) * np.pi / 30 + first_angle
    offsets = [runout * np.cos(2 * np.pi * j / teeth - runout_angle) for j in range(teeth)]
    force = np.zeros((len(angle), 3))
    slices = 30 if helix else 1
    for j in range(teeth):
        for k in range(slices):
            height = (k + 0.5) * depth / slices
            phi = (angle + 2 * np.pi * j / teeth - 2 * height * np.tan(helix) / diameter) % (2 * np.pi)
            chip = np.full(len(phi), np.inf)
            for earlier in range(1, teeth + 1):
                step = offsets[j] - offsets[(j + earlier) % teeth]
                chip = np.minimum(chip, earlier * feed * np.sin(phi) + step)
            cuts = (phi >= immersion[0]) & (phi < immersion[1]) & (chip > 0)
            local = [
                depth / slices * cuts * (coefficients[n] * _hardened(chip, powers[n], round_edge) + coefficients[3 + n])
                for n in range(3)
            ]
            force[:, 0] += -local[0] * np.cos(phi) - local[1] * np.sin(phi)
            force[:, 1] += local[0] * np.sin(phi) - local[1] * np.cos(phi)
            force[:, 2] -= local[2]
    rng = np.random.default_rng(seed)
    return np.asarray(force + noise * np.abs(force).max() * rng.standard_normal(force.shape))


def _hardened(chip: NDArray[np.float64], power: float, round_edge: float) -> NDArray[np.float64]:
    """Return ``h (h / 1 mm)^-m`` or its tangent at the radius of the edge."""
    if power == 0:
        return chip
    at_edge = 1e-3 * (round_edge / 1e-3) ** (1 - power)
    tangent = at_edge + (1 - power) * at_edge / round_edge * (chip - round_edge)
    return np.asarray(np.where(chip > round_edge, 1e-3 * (np.maximum(chip, round_edge) / 1e-3) ** (1 - power), tangent))
