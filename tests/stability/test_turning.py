"""Limits of turning and boring: closed forms, an independent solution of the delay equation, and refusals."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import Frf
from millfrf.core import FileFormatError, InputError, Real
from millfrf.cutting import MillingProcess, read_cutter, read_cutting_process, turning_process, write_cutting_process
from millfrf.stability import (
    certified_cut,
    certified_lobes,
    depth_errors,
    multipliers,
    nyquist_limits,
    simulate_cut,
    surface_error,
)
from modal_fit import ModalModel

RPM = np.pi / 30
TIP = ("T:+X", "T:+Y", "T:+Z")
Modes = list[tuple[float, float, Real]]  # natural frequency (Hz), damping ratio, mass-normalised vector (3,)


def modal_model(modes: Modes) -> ModalModel:
    poles, vectors = [], []
    for frequency, damping, shape in modes:
        omega = 2 * np.pi * frequency
        turned = omega * math.sqrt(1 - damping**2)
        poles.append(complex(-damping * omega, turned))
        vectors.append(shape / np.sqrt(2j * turned))
    return ModalModel(np.array(poles), np.array(vectors), np.array(vectors), TIP, TIP)


def edge_elements(process: MillingProcess, depth: float, approach: float, nose: float) -> list[tuple[float, float]]:
    """Return edge angle (rad) and width (m) of many short elements of an edge, built from the sketch of an insert."""
    count, corner = 4000, nose * (1 - math.cos(approach))
    curved = min(depth, corner)
    turned = math.acos(1 - curved / nose) if nose else 0.0
    elements = [((i + 0.5) * turned / count, nose * turned / count) for i in range(count)] if nose else []
    return [*elements, (approach, max(depth - corner, 0.0) / math.sin(approach))]


def rightmost_growth(
    modes: Modes, process: MillingProcess, speed: float, depth: float, *, approach: float, nose: float = 0.0
) -> float:
    """Return the growth rate (1/s) of the delay equation by Chebyshev collocation of its generator.

    Breda, Maset & Vermiglio, SIAM J. Sci. Comput. 27 (2005) 482-495; differentiation matrix of Trefethen, Spectral
    Methods in MATLAB, chapter 6.
    """
    cutting, normals = np.zeros((3, 3)), np.zeros((3, 3))
    for angle, width in edge_elements(process, depth, approach, nose):
        chip = np.array([math.sin(angle), 0.0, -math.cos(angle)])
        across = np.array([-math.cos(angle), 0.0, -math.sin(angle)])  # along the edge, into the workpiece
        force = process.ktc * (np.array([0.0, 1.0, 0.0]) - process.krc * chip + process.kac * across)
        cutting += width * np.outer(force, chip)
        normals += width * np.outer(chip, chip)
    shapes = np.array([shape for _, _, shape in modes]).T
    omega = 2 * np.pi * np.array([frequency for frequency, _, _ in modes])
    damping = np.diag(2 * np.array([ratio for _, ratio, _ in modes]) * omega)
    flank = process.process_damping / (speed * process.diameter / 2)
    direct, size = shapes.T @ cutting @ shapes, len(modes)
    now = np.block(
        [
            [np.zeros((size, size)), np.eye(size)],
            [direct - np.diag(omega**2), -damping - flank * shapes.T @ normals @ shapes],
        ]
    )
    before = np.block([[np.zeros((size, size))] * 2, [-direct, np.zeros((size, size))]])
    turn = 2 * np.pi / speed
    n = int(30 + 1.3 * omega.max() * turn)
    nodes = np.cos(np.pi * np.arange(n + 1) / n)
    scale = np.where((np.arange(n + 1) == 0) | (np.arange(n + 1) == n), 2.0, 1.0) * (-1.0) ** np.arange(n + 1)
    apart = nodes[:, None] - nodes + np.eye(n + 1)
    slope = np.outer(scale, 1 / scale) / apart
    slope -= np.diag(slope.sum(axis=1))
    generator = np.kron(2 / turn * slope, np.eye(2 * size))
    generator[: 2 * size] = 0.0
    generator[: 2 * size, : 2 * size], generator[: 2 * size, -2 * size :] = now, before
    return float(np.linalg.eigvals(generator).real.max())


def orthogonal(stiffness: float, frequency: float, damping: float) -> ModalModel:
    """Return one mode along the feed."""
    mass = stiffness / (2 * np.pi * frequency) ** 2
    return modal_model([(frequency, damping, np.array([1.0, 0.0, 0.0]) / math.sqrt(mass))])


def test_lowest_limit_of_a_mode_is_that_of_tlusty() -> None:
    """``b = 2 k z (1 + z) / K``, where the chatter frequency is ``f sqrt(1 + 2 z)`` (Altintas, section 4.2)."""
    frequency, damping, stiffness, ktc, krc = 250.0, 0.04, 2e7, 2e9, 0.5
    chatter = frequency * math.sqrt(1 + 2 * damping)
    receptance = 1 / (stiffness * (1 - (chatter / frequency) ** 2 + 2j * damping * chatter / frequency))
    phase = 3 * np.pi + 2 * math.atan2(receptance.imag, receptance.real)
    lobes = np.array([6, 12, 25])
    speeds = 2 * np.pi * chatter / (lobes + np.mod(phase, 2 * np.pi) / (2 * np.pi))
    cut = turning_process(0.05, np.pi / 2, ktc, krc, feed=1e-4)
    limits = certified_lobes(orthogonal(stiffness, frequency, damping), cut, speeds, 0.1)
    expected = 2 * stiffness * damping * (1 + damping) / (ktc * krc)
    np.testing.assert_allclose(limits.depth_limits, expected, rtol=1e-6)
    np.testing.assert_allclose(limits.chatter_frequencies, chatter, rtol=1e-4)
    assert set(limits.status) == {"verified"}
    assert set(limits.bifurcations) == {"hopf"}


def drawn_modes(rng: np.random.Generator) -> Modes:
    modes: Modes = []
    for _ in range(int(rng.integers(1, 4))):
        frequency, direction = float(np.exp(rng.uniform(np.log(60), np.log(500)))), rng.normal(size=3)
        mass = 10 ** rng.uniform(6.5, 7.8) / (2 * np.pi * frequency) ** 2
        modes.append((frequency, float(rng.uniform(0.01, 0.08)), direction / np.linalg.norm(direction) / np.sqrt(mass)))
    return modes


@pytest.mark.parametrize("seed", range(24))
def test_limits_agree_with_the_roots_of_the_delay_equation(seed: int) -> None:
    rng = np.random.default_rng(7000 + seed)
    modes, approach = drawn_modes(rng), float(np.radians(rng.uniform(30, 90)))
    nose = float(rng.choice([0.0, 0.4e-3, 1.6e-3]))
    damping = float(rng.choice([0.0, 5e4]))
    cut = turning_process(
        0.06, approach, 10 ** rng.uniform(8.7, 9.5), rng.uniform(0.2, 0.7), rng.uniform(-0.2, 0.4),
        nose_radius=nose, process_damping=damping, feed=2e-4,
    )  # fmt: skip
    speed = float(np.exp(rng.uniform(np.log(600), np.log(9000)))) * RPM
    lobes = certified_lobes(modal_model(modes), cut, np.array([speed]), 0.03)
    limit = float(lobes.depth_limits[0])
    deepest = min(limit, 0.03)
    for share in (0.25, 0.6, 0.9, 0.998):
        assert rightmost_growth(modes, cut, speed, share * deepest, approach=approach, nose=nose) < 0, (share, limit)
    if math.isfinite(limit):
        assert rightmost_growth(modes, cut, speed, 1.002 * limit, approach=approach, nose=nose) > 0, limit


@pytest.fixture
def bar() -> ModalModel:
    """Return a boring bar with two close modes that are skew to the edge."""
    return modal_model([(230.0, 0.03, np.array([0.05, 0.4, 0.9])), (255.0, 0.025, np.array([0.1, 0.9, -0.4]))])


@pytest.fixture
def cut() -> MillingProcess:
    return turning_process(0.05, math.radians(75.0), 2e9, 0.5, 0.2, feed=2e-4, ktc_std=5e7)


def test_floquet_multipliers_of_a_revolution_agree(bar: ModalModel, cut: MillingProcess) -> None:
    """A turning cut is a milling tooth that stays where it is: collocation of a period knows nothing of roots."""
    speeds = np.array([900.0, 2100.0, 6000.0]) * RPM
    lobes = certified_lobes(bar, cut, speeds, 0.05)
    for speed, limit in zip(speeds, lobes.depth_limits, strict=True):
        assert multipliers(bar, cut, float(speed), 0.999 * float(limit)).stable
        assert not multipliers(bar, cut, float(speed), 1.001 * float(limit)).stable


def test_an_frf_gives_the_limits_of_its_model(bar: ModalModel, cut: MillingProcess) -> None:
    frequencies = np.arange(0.0, 1200.0, 0.25)
    s = 2j * np.pi * frequencies[:, None, None, None]
    residues = bar.right[:, :, None] * bar.left[:, None, :]
    poles = bar.poles[:, None, None]
    values = (residues / (s - poles) + residues.conj() / (s - poles.conj())).sum(axis=1)
    frf = Frf(frequencies, values, TIP, TIP, "receptance", "m/N", frequencies > 0)
    speeds = np.array([1500.0, 3000.0]) * RPM
    expected = certified_lobes(bar, cut, speeds, 0.05).depth_limits
    for limits in (certified_lobes(frf, cut, speeds, 0.05), nyquist_limits(frf, cut, speeds, 0.05)):
        np.testing.assert_allclose(limits.depth_limits, expected, rtol=2e-3)


def test_a_slow_lathe_is_no_burden(bar: ModalModel, cut: MillingProcess) -> None:
    """At 30 rpm a mode of 230 Hz turns 460 times a revolution; limits approach those of the worst phase."""
    lobes = certified_lobes(bar, cut, np.array([30.0, 31.0]) * RPM, 0.05)
    assert set(lobes.numerics) == {"verified"}
    lowest = certified_lobes(bar, cut, np.linspace(1500, 3000, 120) * RPM, 0.05).depth_limits.min()
    np.testing.assert_allclose(lobes.depth_limits, lowest, rtol=5e-3)


def test_limits_of_a_nose_are_verified_by_multipliers_where_these_can(bar: ModalModel) -> None:
    """At 30 rpm a revolution has more nodes than are allowed, and the count of roots is the only witness."""
    rounded = turning_process(0.05, math.radians(75.0), 2e8, 0.5, 0.2, nose_radius=8e-4)
    assert certified_lobes(bar, rounded, np.array([1500.0]) * RPM, 0.01).numerics == ("verified",)
    assert certified_lobes(bar, rounded, np.array([30.0]) * RPM, 0.01).numerics == ("not-verified",)


def test_recommended_cut_and_errors(bar: ModalModel, cut: MillingProcess) -> None:
    speeds = np.linspace(1000, 4000, 60) * RPM
    lobes = certified_lobes(bar, cut, speeds, 0.05)
    errors = depth_errors(bar, cut, lobes)
    np.testing.assert_allclose(errors / lobes.depth_limits, 5e7 / 2e9, rtol=1e-3)  # limits are inverse to ktc
    chosen = certified_cut(bar, cut, lobes, errors, max_depth=0.05)
    near = certified_lobes(bar, cut, chosen.spindle_speed * np.linspace(0.98, 1.02, 9), 0.05).depth_limits
    assert 0 < chosen.depth < near.min()


def test_unmeasured_modes_are_deducted(bar: ModalModel, cut: MillingProcess) -> None:
    """The bound leaves limits of a bar measured up to 20 kHz alone, and none of one measured up to 300 Hz."""
    speeds = np.array([1500.0, 3000.0]) * RPM
    wide, narrow = (
        certified_lobes(replace(bar, band=band), cut, speeds, 0.05) for band in ((0.05, 2e4), (0.05, 300.0))
    )
    assert set(wide.band) == {"measured"}
    assert set(narrow.band) == {"unmeasured"}


def test_files_keep_a_turning_cut(tmp_path: Path, cut: MillingProcess) -> None:
    for process in (cut, turning_process(0.05, 1.2, 1e9, 0.4, nose_radius=8e-4, process_damping=1e5)):
        write_cutting_process(tmp_path / "turn.toml", process)
        again = read_cutting_process(tmp_path / "turn.toml")
        assert again.is_turning
        np.testing.assert_allclose(
            [again.edge_angle, again.ktc, again.krc, again.kac, again.feed_per_tooth, again.ktc_std],
            [process.edge_angle, process.ktc, process.krc, process.kac, process.feed_per_tooth, process.ktc_std],
        )
        assert [round(part.edge_angle, 8) for part in again.profile] == [
            round(part.edge_angle, 8) for part in process.profile
        ]


def test_mistakes_in_a_file_are_named(tmp_path: Path) -> None:
    file = tmp_path / "turn.toml"
    file.write_text("[turning]\ndiameter_m = 0.05\nktc_pa = 1e9\nkrc = 0.3\n[cutting]\nteeth = 2\n")
    with pytest.raises(FileFormatError, match=r"keep \[turning\]"):
        read_cutting_process(file)
    file.write_text("[turning]\ndiameter_m = 0.05\nktc_pa = 1e9\n")
    with pytest.raises(FileFormatError, match=r"turning\.krc is missing"):
        read_cutting_process(file)
    file.write_text("[turning]\ndiameter_m = 0.05\nktc_pa = 1e9\nkrc = 0.3\nedge_angle_deg = 95\n")
    with pytest.raises(InputError, match="edge angle 95 deg"):
        read_cutting_process(file)
    file.write_text("[turning]\ndiameter_m = 0.05\nktc_pa = 1e9\nkrc = 0.3\nnose_radius_m = -1e-3\n")
    with pytest.raises(InputError, match="nose radius"):
        read_cutting_process(file)
    with pytest.raises(InputError, match="describes turning"):
        read_cutter(file)


def test_what_takes_milling_only_refuses(bar: ModalModel, cut: MillingProcess) -> None:
    with pytest.raises(InputError, match="does not take turning"):
        simulate_cut(bar, cut, 100.0, 1e-3)
    with pytest.raises(InputError, match="does not take turning"):
        surface_error(bar, cut, np.array([100.0]), 1e-3)
    with pytest.raises(InputError, match="one edge"):
        replace(cut, teeth=2)
    with pytest.raises(InputError, match="all the time"):
        replace(cut, exit_angle=3.0)
