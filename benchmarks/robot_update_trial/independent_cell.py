"""A robot's file as a cell of its own: kinematics, finite elements, modes, joint dashpots and random forces in time."""

import tomllib
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, expm

from .elements import beam_matrices, null_basis, tube

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

HIGHEST = 1500.0
"""Modes up to here are integrated, Hz; higher ones follow at once."""

STEADY = 250.0
"""The same with a joint law, whose force lags by a step: higher modes would make it unstable, Hz."""

ELEMENTS = 5
"""Elements of each link: the tested model has one."""


@dataclass(frozen=True)
class Truth:
    """What is wrong in the file, in the cell's own words.

    Parameters
    ----------
    joints
        Factor on each joint's stiffness, by its frame.
    dashpots
        Damping ratio that a joint's dashpot adds at 20 Hz, by its frame.
    damping, links
        Factors.
    payload
        Mass (kg, of either sign) and place from the tip in the tool frame, m; or None.
    spindle
        Factor on mass and inertia of the spindle's body.
    tool
        Compliance between spindle and tip, across and along, m/N, and mass on it, kg; or None.
    base
        Tilting compliance of the base, rad/(N m).
    body
        Factor on mass and inertia of another body, by its index: foreign to the tested program.
    one_link
        Factor on the stiffness of one link, by its index: foreign.
    tilting
        Compliance of a joint's bearing across its axis, rad/(N m), by frame: foreign.
    cubic
        Joint whose torque grows by ``1 + (angle / size)^2``: its frame and the size, rad: foreign.
    """

    joints: dict[str, float] = field(default_factory=dict)
    dashpots: dict[str, float] = field(default_factory=dict)
    damping: float = 1.0
    links: float = 1.0
    payload: tuple[float, tuple[float, float, float]] | None = None
    spindle: float = 1.0
    tool: tuple[float, float, float] | None = None
    base: float = 0.0
    body: tuple[int, float] | None = None
    one_link: tuple[int, float] | None = None
    tilting: tuple[str, float] | None = None
    cubic: tuple[str, float] | None = None


@dataclass(frozen=True)
class Cell:
    """Reduced matrices of one posture: modes with their damping matrix, motion of tip and of the cubic joint."""

    squares: Real
    damping: Real
    tip: Real
    cubic: tuple[Real, float, float] | None


def read_tables(text: str) -> dict[str, Any]:
    """The file's tables, as they stand."""
    return tomllib.loads(text)


def cell_at(tables: dict[str, Any], angles: Real, truth: Truth) -> Cell:
    """Assemble the cell at driven angles, rad."""
    frames = _frames(tables, angles)
    places, nodes = _places(tables, frames)
    beams, extra = [], []
    for number, link in enumerate(tables["links"]):
        chain = [link["nodes"][0]]
        start, end = (places[n] for n in link["nodes"])
        for step in range(1, ELEMENTS):
            chain.append(nodes + len(extra))
            extra.append(start + (end - start) * step / ELEMENTS)
        chain.append(link["nodes"][1])
        own = link["tube"]
        factor = truth.links * (truth.one_link[1] if truth.one_link and truth.one_link[0] == number else 1.0)
        section = tube(own["outer_m"], own["inner_m"], own["young_pa"], own["shear_pa"], own["density_kg_per_m3"])
        section |= {key: factor * section[key] for key in ("ea", "ei", "gj", "ga")}
        beams += [(a, b, section) for a, b in pairwise(chain)]
    points = np.vstack([np.array([places[n] for n in range(nodes)]), *[p[None] for p in extra]])
    return _assembled(tables, truth, frames, points, beams)


def _frames(tables: dict[str, Any], angles: Real) -> dict[str, Real]:
    result, driven = {"0": np.eye(4)}, iter(angles)
    for row in tables["frames"]:
        turn = np.radians(row.get("theta_deg", 0.0)) + (next(driven) if row.get("motion", "revolute") != "fixed" else 0)
        ca, sa = np.cos(np.radians(row.get("alpha_deg", 0.0))), np.sin(np.radians(row.get("alpha_deg", 0.0)))
        ct, st = np.cos(turn), np.sin(turn)
        along = np.array([[1, 0, 0, row.get("d_m", 0.0)], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1]])
        about = np.array([[ct, -st, 0, 0], [st, ct, 0, 0], [0, 0, 1, row.get("r_m", 0.0)], [0, 0, 0, 1]])
        result[row["name"]] = result[row["antecedent"]] @ along @ about
    return result


def _places(tables: dict[str, Any], frames: dict[str, Real]) -> tuple[dict[int, Real], int]:
    places: dict[int, Real] = {}
    for joint in tables["joints"]:
        for node in joint["nodes"]:
            places.setdefault(node, frames[joint["frame"]][:3, 3])
    for point in tables["points"]:
        frame = frames[point["frame"]]
        places[point["node"]] = frame[:3, :3] @ np.array(point["at_m"]) + frame[:3, 3]
    return places, 1 + max(places)


def _assembled(tables: dict[str, Any], truth: Truth, frames: dict[str, Real], points: Real, beams: list[Any]) -> Cell:
    tip = tables["robot"]["tip_node"]
    size = 6 * len(points) + (6 if truth.tool else 0)
    stiffness, mass = np.zeros((size, size)), np.zeros((size, size))
    for a, b, section in beams:
        k, m = beam_matrices(section, points[a], points[b])
        index = np.r_[6 * a : 6 * a + 6, 6 * b : 6 * b + 6]
        stiffness[np.ix_(index, index)] += k
        mass[np.ix_(index, index)] += m
    for number, body in enumerate(tables["bodies"]):
        factor = truth.body[1] if truth.body and truth.body[0] == number else 1.0
        factor *= truth.spindle if number == len(tables["bodies"]) - 1 else 1.0
        axes = frames[body["frame"]][:3, :3]
        inertia = axes @ np.diag(body.get("inertia_kg_m2", [0.0] * 3)) @ axes.T
        arm = axes @ np.array(body.get("centre_m", [0.0] * 3))
        _add_mass(mass, body["node"], factor * body["mass_kg"], arm, factor * inertia)
    carrier = tables["bodies"][-1]["node"]
    tool_axes = frames[tables["robot"]["tool_frame"]][:3, :3]
    if truth.payload:
        at = points[tip] + tool_axes @ np.array(truth.payload[1])
        _add_mass(mass, carrier, truth.payload[0], at - points[carrier], np.zeros((3, 3)))
    rows, dashpots, cubic = [_floor(stiffness, truth.base)], [], None
    for joint in tables["joints"]:
        relative = _relative(joint, frames[joint["frame"]], points, size)
        k = joint["turning_nm_per_rad"] * truth.joints.get(joint["frame"], 1.0)
        stiffness += k * np.outer(relative[5], relative[5])
        held = [0, 1, 2, 3, 4]
        if truth.tilting and truth.tilting[0] == joint["frame"]:
            held = [0, 1, 2]
            stiffness += relative[3:5].T @ relative[3:5] / truth.tilting[1]
        rows.append(relative[held])
        if joint["frame"] in truth.dashpots:
            ratio = truth.dashpots[joint["frame"]]
            dashpots.append((2 * ratio * joint["turning_nm_per_rad"] / (2 * np.pi * 20), relative[5]))
        if truth.cubic and truth.cubic[0] == joint["frame"]:
            cubic = (relative[5], k, truth.cubic[1])
    node = tip
    if truth.tool:
        node = len(points)
        _add_tool(stiffness, mass, rows, (tip, node), tool_axes, truth.tool)
    return _reduced(tables, truth, stiffness, mass, np.vstack(rows), node, dashpots, cubic)


def _floor(stiffness: Real, compliance: float) -> Real:
    """Rows that hold the base; one that tilts is held by springs in two directions."""
    held = np.eye(len(stiffness))[:6]
    if not compliance:
        return held
    stiffness[3:5, 3:5] += np.eye(2) / compliance
    return np.asarray(held[[0, 1, 2, 5]])


def _add_tool(
    stiffness: Real, mass: Real, rows: list[Real], pair: tuple[int, int], axes: Real, tool: tuple[float, float, float]
) -> None:
    size = len(stiffness)
    (tip, node), (lateral, axial, kilograms) = pair, tool
    shift = np.zeros((6, size))
    shift[:, 6 * node : 6 * node + 6], shift[:, 6 * tip : 6 * tip + 6] = np.eye(6), -np.eye(6)
    local = axes.T @ shift[:3]
    stiff = [1 / lateral, 1 / lateral, 1 / axial if axial else 0.0]
    stiffness += local.T @ np.diag(stiff) @ local
    rows.append(shift[3:] if axial else np.vstack([shift[3:], local[2:]]))
    _add_mass(mass, node, kilograms, np.zeros(3), np.zeros((3, 3)))


def _add_mass(mass: Real, node: int, kilograms: float, arm: Real, inertia: Real) -> None:
    x, y, z = arm
    move = np.hstack([np.eye(3), np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])])
    block = kilograms * move.T @ move
    block[3:, 3:] += inertia
    mass[6 * node : 6 * node + 6, 6 * node : 6 * node + 6] += block


def _relative(joint: dict[str, Any], frame: Real, points: Real, size: int) -> Real:
    """Motion of the second node's body against the first's at the joint, in its axes, (6, size)."""
    rows = np.zeros((6, size))
    for node, sign in zip(joint["nodes"], (-1, 1), strict=True):
        x, y, z = frame[:3, 3] - points[node]
        move = np.eye(6)
        move[:3, 3:] = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
        rows[:, 6 * node : 6 * node + 6] += sign * np.kron(np.eye(2), frame[:3, :3].T) @ move
    return rows


def _reduced(
    tables: dict[str, Any],
    truth: Truth,
    stiffness: Real,
    mass: Real,
    rows: Real,
    tip: int,
    dashpots: list[tuple[float, Real]],
    cubic: tuple[Real, float, float] | None,
) -> Cell:
    basis = null_basis(rows)
    squares, shapes = eigh(basis.T @ stiffness @ basis, basis.T @ mass @ basis)
    whole = basis @ shapes
    damping = np.diag(2 * truth.damping * tables["damping"]["ratio"] * np.sqrt(squares))
    for size, row in dashpots:
        moved = row @ whole
        damping += size * np.outer(moved, moved)
    own = None if cubic is None else (cubic[0] @ whole, cubic[1], cubic[2])
    return Cell(squares, damping, whole[6 * tip : 6 * tip + 3], own)


def receptance(cell: Cell, frequencies: Real) -> Complex:
    """Receptance of the tip without noise, m/N, (n_lines, 3, 3)."""
    omega = 2 * np.pi * np.asarray(frequencies)[:, None, None]
    dynamic = np.diag(cell.squares) - omega**2 * np.eye(len(cell.squares)) + 1j * omega * cell.damping
    return np.asarray(cell.tip @ np.linalg.solve(dynamic, cell.tip.T.astype(complex)[None]))


def recorded(
    cell: Cell, seconds: float, rate: float, noise: float, generator: np.random.Generator, level: float = 100.0
) -> tuple[Real, Real]:
    """Random forces in three directions and the tip's motion, each with white noise, (n, 3).

    Modes to HIGHEST are integrated exactly between samples, where the force is held (the force that is recorded is the
    held one, averaged over the step); higher ones follow at once. A cubic joint acts as a force of the step before.
    """
    top = HIGHEST if cell.cubic is None else STEADY
    kept = np.flatnonzero(cell.squares < (2 * np.pi * top) ** 2)
    fine, n = 8, round(seconds * rate)
    step = 1 / (rate * fine)
    low = cell.tip[:, kept]
    rest = np.delete(cell.tip, kept, axis=1)
    static = (rest / np.delete(cell.squares, kept)) @ rest.T
    m = len(kept)
    own = np.vstack(
        [
            np.hstack([np.zeros((m, m)), np.eye(m)]),
            np.hstack([-np.diag(cell.squares[kept]), -cell.damping[np.ix_(kept, kept)]]),
        ]
    )
    inputs = [low.T] if cell.cubic is None else [low.T, cell.cubic[0][kept][:, None]]
    drive = np.vstack([np.zeros((m, sum(i.shape[1] for i in inputs))), np.hstack(inputs)])
    width = drive.shape[1]
    whole = expm(np.block([[own, drive], [np.zeros((width, 2 * m + width))]]) * step)
    ahead, push = whole[: 2 * m, : 2 * m], whole[: 2 * m, 2 * m :]
    force = _band_limited(n * fine, 1 / step, rate, generator) * level
    state, motion = np.zeros(2 * m), np.empty((n * fine, 3))
    for i in range(n * fine):
        motion[i] = low @ state[:m] + static @ force[i]
        u = force[i]
        if cell.cubic is not None:
            angle = cell.cubic[0][kept] @ state[:m]
            u = np.append(u, -cell.cubic[1] * angle**3 / cell.cubic[2] ** 2)
        state = ahead @ state + push @ u
    f, x = _halved_in_time(force, step, fine), motion[::fine]
    f = f + noise * f.std(axis=0) * generator.normal(size=f.shape)
    x = x + noise * x.std(axis=0) * generator.normal(size=x.shape)
    return f, x


def _band_limited(n: int, fine_rate: float, rate: float, generator: np.random.Generator) -> Real:
    """Random force without anything above 0.4 of the recorder's rate."""
    lines = np.fft.rfft(generator.normal(size=(n, 3)), axis=0)
    lines[np.fft.rfftfreq(n, 1 / fine_rate) > 0.4 * rate] = 0
    force = np.fft.irfft(lines, n, axis=0)
    return np.asarray(force / force.std(axis=0))


def _halved_in_time(force: Real, step: float, fine: int) -> Real:
    """The held force lags by half a fine step and loses ``sinc(f step)``: it is recorded as it acts."""
    lines = np.fft.rfft(force, axis=0)
    frequencies = np.fft.rfftfreq(len(force), step)
    lines *= (np.exp(-1j * np.pi * frequencies * step) * np.sinc(frequencies * step))[:, None]
    return np.asarray(np.fft.irfft(lines, len(force), axis=0)[::fine])
