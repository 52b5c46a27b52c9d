"""What `robot compensate` adds for weight and payload on the KUKA, against unit loads: no code of the package in it.

The robot's file is read as TOML. Places come from its Denavit-Hartenberg numbers (Khalil & Kleinfinger 1986), and the
tip's deflection from the unit-load theorem (Timoshenko & Young, Theory of Structures, chapter 7): over joints and over
the length of each tube, internal forces and moments of the weight times those of a unit load at the tip over the
stiffness. There is no matrix to assemble and no node.
"""

import csv
import tomllib
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from millfrf.command_line import DONE, run

Real = NDArray[np.float64]
NAME = "kuka_kr90_r3100"
FILE: dict[str, Any] = tomllib.loads(files("millfrf.robot_model").joinpath("robots", f"{NAME}.toml").read_text("utf-8"))
READY = np.radians(FILE["poses"][0]["driven_deg"])
DOWN = np.array([0.0, 0.0, -9.80665])
PLACES = np.array([[1.2, 0.0, 0.8], [1.5, 0.0, 0.4], [2.3, 0.6, 0.8]])
TIP_DOWN = np.array([np.pi, 0.0, 0.0])
ENDS = {(0, 1): ("0", "1"), (2, 3): ("1", "2"), (4, 5): ("2", "3"), (6, 7): ("3", "4"), (10, 11): ("6", "tool")}
"""Frames at the ends of each tube: its nodes are the joints' places."""
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(6)


def frames(q: Real) -> dict[str, Real]:
    """Each frame's place: turn about x, move along x, turn about z, move along z."""
    placed = {"0": np.eye(4)}
    turned = iter(q)
    for frame in FILE["frames"]:
        joint = 0.0 if frame.get("motion") == "fixed" else next(turned)
        own = np.eye(4)
        about_x = Rotation.from_euler("x", frame.get("alpha_deg", 0.0), degrees=True).as_matrix()
        about_z = Rotation.from_euler("z", np.radians(frame.get("theta_deg", 0.0)) + joint).as_matrix()
        own[:3, :3] = about_x @ about_z
        own[:3, 3] = [frame.get("d_m", 0.0), 0, 0] + about_x @ [0, 0, frame.get("r_m", 0.0)]
        placed[frame["name"]] = placed[frame["antecedent"]] @ own
    return placed


@dataclass(frozen=True)
class Load:
    """Weight of a mass spread evenly from one place to another (m; kg), beyond so many joints."""

    first: Real
    last: Real
    mass: float
    after: float

    def beyond(self, link: float, share: float) -> tuple[Real, Real]:
        """Force and its place of the part that hangs beyond ``share`` of the ``link``-th tube (or joint)."""
        if self.after != link:
            return self.mass * DOWN * (self.after > link), (self.first + self.last) / 2
        start = self.first + share * (self.last - self.first)
        return (1 - share) * self.mass * DOWN, (start + self.last) / 2


def tubes(placed: dict[str, Real]) -> list[tuple[float, Real, Real, dict[str, float]]]:
    """Each tube: joints before it and a half, its ends, its numbers."""
    result = []
    for link in FILE["links"]:
        first, last = ENDS[tuple(link["nodes"])]
        result.append((float(first) + 0.5, placed[first][:3, 3], placed[last][:3, 3], link["tube"]))
    return result


def loads(placed: dict[str, Real], payload: float, centre: Real) -> list[Load]:
    """Tubes, bodies and payload with their weights."""
    result = []
    for after, first, last, tube in tubes(placed):
        area = np.pi / 4 * (tube["outer_m"] ** 2 - tube["inner_m"] ** 2)
        result.append(Load(first, last, tube["density_kg_per_m3"] * area * float(np.linalg.norm(last - first)), after))
    for body in FILE["bodies"]:
        frame = placed[body["frame"]]
        at = frame[:3, 3] + frame[:3, :3] @ body.get("centre_m", [0.0, 0.0, 0.0])
        result.append(Load(at, at, body["mass_kg"], float(body["frame"]) + 0.25))
    tool = placed["tool"]
    at = tool[:3, 3] + tool[:3, :3] @ centre
    return [*result, Load(at, at, payload, 7.0)]


def internal(hung: list[Load], link: float, share: float, at: Real) -> tuple[Real, Real]:
    """Force and moment about ``at`` of all that hangs beyond."""
    parts = [each.beyond(link, share) for each in hung]
    force = np.sum([part[0] for part in parts], axis=0)
    return force, np.sum([np.cross(place - at, weight) for weight, place in parts], axis=0)


def sag(q: Real, payload: float = 0.0, centre: Real | None = None) -> Real:
    """Deflection of the tip under its weight and a payload, m, shape (3,)."""
    placed = frames(q)
    hung, tip = loads(placed, payload, np.zeros(3) if centre is None else centre), placed["tool"][:3, 3]
    total = np.zeros(3)
    for joint in FILE["joints"]:
        frame = placed[joint["frame"]]
        at, axis = frame[:3, 3], frame[:3, 2]
        _, moment = internal(hung, float(joint["frame"]), 0.0, at)
        total += np.cross(axis, tip - at) * (moment @ axis) / joint["turning_nm_per_rad"]
    for link, first, last, tube in tubes(placed):
        length, along = float(np.linalg.norm(last - first)), (last - first) / np.linalg.norm(last - first)
        stiffness = of_tube(tube)
        for point, weight in zip((POINTS + 1) / 2, WEIGHTS / 2, strict=True):
            at = first + point * (last - first)
            force, moment = internal(hung, link, point, at)
            parts = ((along @ force) * along, force - (along @ force) * along)
            turns = ((along @ moment) * along, moment - (along @ moment) * along)
            strain = parts[0] / stiffness["EA"] + parts[1] / stiffness["kGA"]
            bend = turns[0] / stiffness["GJ"] + turns[1] / stiffness["EI"]
            # a unit load u at the tip: its force is u, its moment (tip - at) x u
            total += weight * length * (strain + np.cross(bend, tip - at))
    return total


def of_tube(tube: dict[str, float]) -> dict[str, float]:
    """Stiffnesses of a tube; shear factor of Cowper 1966, Table 1."""
    outer, inner, young, shear = (tube[key] for key in ("outer_m", "inner_m", "young_pa", "shear_pa"))
    area, second = np.pi / 4 * (outer**2 - inner**2), np.pi / 64 * (outer**4 - inner**4)
    nu, m2 = young / (2 * shear) - 1, (inner / outer) ** 2
    factor = 6 * (1 + nu) * (1 + m2) ** 2 / ((7 + 6 * nu) * (1 + m2) ** 2 + (20 + 12 * nu) * m2)
    return {"EA": young * area, "EI": young * second, "GJ": 2 * shear * second, "kGA": factor * shear * area}


def joints_at(place: Real, attitude: Real, near: Real) -> Real:
    """Joint values that bring the tool there, from the places alone."""
    wanted = Rotation.from_rotvec(attitude).as_matrix()

    def missed(q: Real) -> Real:
        tool = frames(q)["tool"]
        off = Rotation.from_matrix(wanted.T @ tool[:3, :3]).as_rotvec()
        return np.concatenate([tool[:3, 3] - place, off])

    starts = [near + [0, 0, 0, 0, 0, turn] for turn in (0.0, np.pi / 2, np.pi, -np.pi / 2)]
    result = min(starts, key=lambda q: float(np.abs(missed(q)[3:]).max()))
    for _ in range(20):
        slopes = [(missed(result + step) - missed(result - step)) / 2e-6 for step in 1e-6 * np.eye(6)]
        result = result - np.linalg.solve(np.array(slopes).T, missed(result))
    assert np.abs(missed(result)).max() < 1e-11
    return np.asarray(result)


def compensated(folder: Path, *options: str) -> list[dict[str, str]]:
    """Rows of what the command writes for a path without forces."""
    path, out = folder / "path.csv", folder / "out.csv"
    rows = "".join(f"{x},{y},{z},{np.pi:.15g},0,0,0,0,0\n" for x, y, z in PLACES)
    path.write_text("x_m,y_m,z_m,rx_rad,ry_rad,rz_rad,fx_n,fy_n,fz_n\n" + rows, encoding="utf-8")
    assert run(["robot", "compensate", NAME, str(path), "--out", str(out), *options]) == DONE
    with out.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def numbers(row: dict[str, str], *names: str) -> Real:
    return np.array([float(row[name]) for name in names])


@pytest.mark.long
@pytest.mark.parametrize(
    ("options", "payload", "sizes_mm"),
    [
        ((), 0.0, (0.5053, 0.6040, 1.2976)),
        (("--payload", "60", "--payload-at", "0.05", "-0.02", "-0.2"), 60.0, (0.7946, 0.8880, 1.7772)),
    ],
    ids=["own weight", "payload of 60 kg"],
)
def test_compensation_is_that_of_unit_loads(
    tmp_path: Path, options: tuple[str, ...], payload: float, sizes_mm: tuple[float, ...]
) -> None:
    """On the path as given to 1e-7; and from where the corrected path sends the tool, weight brings it to the path."""
    centre, q = np.array([0.05, -0.02, -0.2]), READY
    for place, row, size in zip(PLACES, compensated(tmp_path, *options), sizes_mm, strict=True):
        q = joints_at(place, TIP_DOWN, q)
        expected = sag(q, payload, centre)
        assert 1e3 * np.linalg.norm(expected) == pytest.approx(size, abs=6e-5)
        assert numbers(row, "weight_x_m", "weight_y_m", "weight_z_m") == pytest.approx(expected, rel=1e-7, abs=1e-11)
        sent = numbers(row, "x_m", "y_m", "z_m")
        there = joints_at(sent, numbers(row, "rx_rad", "ry_rad", "rz_rad"), q)
        assert sent + sag(there, payload, centre) == pytest.approx(place, abs=1e-8)  # nine digits
