"""Response of the structure within the collocated pieces of a period, closed by the cutting force; compiled."""

import numpy as np

from millfrf.core import Complex, Real
from millfrf.core.compilation import compiled, inner_loop


@compiled(
    "(complex128[::1], complex128[:,::1], complex128[:,::1], float64[:,::1], float64[::1], float64[::1], float64, "
    "float64[::1], float64[:,::1], float64[:,:,::1])"
)
def piece_matrices(
    poles: Complex,
    seen: Complex,
    left: Complex,
    direct: Real,
    begins: Real,
    ends: Real,
    duration: float,
    nodes: Real,
    integral: Real,
    forcing: Real,
) -> tuple[Real, Complex]:
    """Compute the arrays ``steps`` and ``gaps`` of `CutPeriod` from the force per channel at the nodes.

    With the channels ``W = ring z + G F`` and the force ``F = forcing W - B`` they are
    ``W = (I - G forcing)^-1 (ring z - G B)``.
    """
    pieces, count, modes = len(begins), len(nodes), len(poles)
    channels, forces = direct.shape
    n, m, size = count * channels, count * forces, 2 * modes
    steps = np.empty((pieces, n + size, size + m))
    gaps = np.empty((pieces + 1, modes), dtype=np.complex128)
    ring, gain = np.empty((n, size)), np.empty((n, m))
    kick, turn = np.empty((size, m)), np.empty((size, size))
    loop, drive, kicked = np.empty((n, n)), np.empty((n, size + m)), np.empty((size, n))
    end = 0.0
    for k in range(pieces):
        half = (ends[k] - begins[k]) / 2
        for r in range(modes):
            gaps[k, r] = np.exp(poles[r] * (begins[k] - end))
        end = ends[k]
        _respond(poles, seen, left, direct, half, nodes, integral, ring, gain, kick, turn)
        _close(gain, forcing[k * count : (k + 1) * count], loop)
        for i in range(n):
            loop[i, i] += 1.0
        drive[:, :size] = ring
        drive[:, size:] = -gain
        moved = np.linalg.solve(loop, drive)
        _close(kick, forcing[k * count : (k + 1) * count], kicked)
        steps[k, :n], steps[k, n:] = moved, -(kicked @ moved)
        steps[k, n:, :size] += turn
        steps[k, n:, size:] -= kick
    for r in range(modes):
        gaps[pieces, r] = np.exp(poles[r] * (duration - end))
    return steps, gaps


@inner_loop
def _close(gain: Real, forcing: Real, loop: Real) -> None:
    """Write ``- gain forcing``, with the block diagonal matrix of the force per channel."""
    count, forces, channels = forcing.shape
    for row in range(len(gain)):
        for j in range(count):
            for b in range(channels):
                total = 0.0
                for a in range(forces):
                    total += gain[row, j * forces + a] * forcing[j, a, b]
                loop[row, j * channels + b] = -total


@compiled
def _respond(
    poles: Complex,
    seen: Complex,
    left: Complex,
    direct: Real,
    half: float,
    nodes: Real,
    integral: Real,
    ring: Real,
    gain: Real,
    kick: Real,
    turn: Real,
) -> None:
    """Write the structure's response in a piece: to its state at the beginning, and to forces at the nodes.

    ``ring`` and ``gain`` are the channels at the nodes, ``turn`` and ``kick`` the state at the end.
    """
    count, modes = len(nodes), len(poles)
    channels, forces = direct.shape
    gain[:] = 0.0
    turn[:] = 0.0
    for r in range(modes):
        pole = poles[r]
        over = np.exp(pole * 2 * half)
        turn[r, r], turn[r, modes + r] = over.real, -over.imag
        turn[modes + r, r], turn[modes + r, modes + r] = over.imag, over.real
        waves = np.exp(pole * half * (nodes + 1.0))
        backs = 2 * half / waves
        for i in range(count):
            for a in range(channels):
                moved = 2 * seen[r, a] * waves[i]
                ring[i * channels + a, r], ring[i * channels + a, modes + r] = moved.real, -moved.imag
            for b in range(forces):
                pushed = left[r, b] * over * backs[i] * (0.5 * integral[count - 1, i])
                kick[r, i * forces + b], kick[modes + r, i * forces + b] = pushed.real, pushed.imag
        _add_response(seen[r], left[r], waves, backs, integral, gain)
    for i in range(count):
        for a in range(channels):
            for b in range(forces):
                gain[i * channels + a, i * forces + b] += direct[a, b]


@inner_loop
def _add_response(seen: Complex, left: Complex, waves: Complex, backs: Complex, integral: Real, gain: Real) -> None:
    """Add the response of one mode at the nodes to forces at the nodes."""
    count, channels, forces = len(waves), len(seen), len(left)
    for i in range(count):
        for a in range(channels):
            moved = seen[a] * waves[i]
            for j in range(count):
                wave = moved * backs[j] * integral[i, j]
                for b in range(forces):
                    gain[i * channels + a, j * forces + b] += (wave * left[b]).real
