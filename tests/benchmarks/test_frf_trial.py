"""The trial of modal fits on FRFs: its synthesis, its noise, its rule of what can be seen, its scores and limits."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # benchmarks are no installed package

from benchmarks.frf_trial.isolated import Limits, running
from benchmarks.frf_trial.noise import draw_noise
from benchmarks.frf_trial.observable import visibility
from benchmarks.frf_trial.problem import (
    Answer,
    FoundMode,
    Problem,
    read_answer,
    read_problem,
    write_answer,
    write_problem,
)
from benchmarks.frf_trial.scoring import score
from benchmarks.frf_trial.sets import draw_set
from benchmarks.frf_trial.spectrum import FEWEST_LINES, draw_spectrum
from benchmarks.frf_trial.stable_clusters import OrderPoles, candidates, choose
from benchmarks.frf_trial.structure import Structure, poles_of
from benchmarks.frf_trial.tables import report
from estimation import Frf


def _structure(frequencies: list[float], dampings: list[float], n: int = 3, seed: int = 0) -> Structure:
    rng = np.random.default_rng(seed)
    right, left = rng.standard_normal((len(frequencies), n)) + 0j, rng.standard_normal((len(frequencies), 2)) + 0j
    return Structure(poles_of(np.array(frequencies), np.array(dampings)), right, left, np.zeros((n, 2)))


def test_frfs_are_those_of_mass_damping_and_stiffness() -> None:
    rng = np.random.default_rng(3)
    stiffness = rng.standard_normal((4, 4))
    stiffness = 1e4 * (stiffness @ stiffness.T + 2 * np.eye(4))
    mass = np.diag([1.0, 2.0, 0.5, 3.0])
    damping = 0.4 * mass + 3e-4 * stiffness
    squares, shapes = np.linalg.eigh(np.diag(np.diag(mass) ** -0.5) @ stiffness @ np.diag(np.diag(mass) ** -0.5))
    shapes = np.diag(np.diag(mass) ** -0.5) @ shapes
    omega = np.sqrt(squares)
    structure = Structure(
        poles_of(omega / (2 * np.pi), 0.2 / omega + 1.5e-4 * omega),
        shapes.T + 0j,
        shapes.T[:, :2] + 0j,
        np.zeros((4, 2)),
    )
    axis = np.linspace(5.0, 80.0, 40)
    s = 2j * np.pi * axis
    direct = np.linalg.inv(mass * (s**2)[:, None, None] + damping * s[:, None, None] + stiffness)[:, :, :2]
    np.testing.assert_allclose(structure.frf(axis, 2), direct * (s**2)[:, None, None], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", range(30))
def test_modes_stand_clear_of_the_edges_and_pairs_are_close(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n_inside = 2 + seed % 14
    spectrum = draw_spectrum(rng, n_inside, 3000)
    f, width = spectrum.frequencies[spectrum.inside], (2 * spectrum.dampings * spectrum.frequencies)[spectrum.inside]
    assert len(f) == n_inside
    assert np.all(np.diff(spectrum.frequencies) > 0)
    assert np.all((f > spectrum.band[0]) & (f < spectrum.band[1]))
    outside = spectrum.frequencies[~spectrum.inside]
    assert not np.any((outside > spectrum.band[0]) & (outside < spectrum.band[1]))
    assert width.min() > 2.99 * spectrum.step
    assert (spectrum.band[1] - spectrum.band[0]) / spectrum.step > FEWEST_LINES - 1
    first = int(np.flatnonzero(spectrum.inside)[0])
    for lower in spectrum.pairs:
        k = lower - first
        assert 0 < f[k + 1] - f[k] < 0.5 * (width[k] + width[k + 1]) + 1e-9


def test_same_seed_same_set_and_files_hold_all_of_it(tmp_path: Path) -> None:
    first, two = draw_set(5, 4), draw_set(5, 4)  # 4: coherence is stated
    np.testing.assert_array_equal(first.problem.values, two.problem.values)
    assert first.truth == two.truth
    assert not np.array_equal(first.problem.values.shape, draw_set(6, 4).problem.values.shape)
    write_problem(first.problem, tmp_path / "p.npz")
    back = read_problem(tmp_path / "p.npz")
    assert (back.quantity, back.band, back.responses) == (
        first.problem.quantity,
        first.problem.band,
        first.problem.responses,
    )
    np.testing.assert_array_equal(back.coherence, first.problem.coherence)
    answer = Answer((FoundMode(1.0, 0.1, None, 0.2, ((1.0, 0.0),)),), said=("x",))
    write_answer(answer, tmp_path / "a.json")
    assert read_answer(tmp_path / "a.json").modes[0].damping_error == 0.2


@pytest.mark.parametrize("told", ["covariance", "estimated covariance", "coherence"])
def test_what_is_told_of_the_noise_is_its_variance(told: str) -> None:
    rng = np.random.default_rng(7)
    axis = np.linspace(20, 60, 4000)
    clean = _structure([30.0, 45.0], [0.02, 0.01]).frf(axis, 2)
    noise = draw_noise(rng, clean, np.ones(len(axis), bool), 0.02, "rms of each FRF", told)
    sample = noise.sample(rng)
    np.testing.assert_allclose(np.mean(np.abs(sample) ** 2, axis=0), noise.variance.mean(axis=0), rtol=0.1)
    if noise.response is not None and noise.excitation is not None:
        stated = np.einsum("kpp,kqq->pq", noise.response, noise.excitation).real / len(axis)
        np.testing.assert_allclose(stated, noise.variance.mean(axis=0), rtol=0.05)
        return
    coherence = noise.coherence(rng, clean + sample)
    frf = Frf(
        axis,
        clean + sample,
        ("A:+X", "B:+X", "C:+X"),
        ("A:+X", "B:+X"),
        "accelerance",
        "m/s^2/N",
        np.ones(len(axis), bool),
        coherence=coherence,
        averages=np.full((3, 2), noise.averages),
    )
    stated = frf.entry_variance()
    assert stated is not None
    np.testing.assert_allclose(stated.mean(axis=0), noise.variance.mean(axis=0), rtol=0.1)


def test_visibility_of_a_lone_mode_is_what_least_squares_lose_without_it() -> None:
    structure, axis = _structure([40.0], [0.01]), np.linspace(20, 60, 801)
    variance = np.full((len(axis), 3, 2), 4.0)
    seen = visibility(structure, 0, axis, np.ones(len(axis), bool), variance, 2)
    near = np.abs(axis - 40) <= 6 * 0.8
    clean = structure.frf(axis, 2)[near].reshape(near.sum(), -1)
    smooth = np.vander(axis[near] - 40, 3).astype(complex)
    left = clean - smooth @ np.linalg.lstsq(smooth, clean, rcond=None)[0]
    assert seen.energy == pytest.approx(np.sum(np.abs(left) ** 2) / 4.0 / 5, rel=0.02)
    peak = np.sort(np.abs(structure.frf(np.array([40.0]), 2)).ravel())[-1]
    assert seen.peak == pytest.approx(peak / 2.0, rel=0.02)


def test_a_mode_that_another_can_imitate_is_not_demanded() -> None:
    axis = np.linspace(20, 60, 1601)
    variance, everywhere = np.full((len(axis), 3, 2), 1.0), np.ones(len(axis), bool)
    apart = _structure([40.0, 40.6], [0.01, 0.01])
    same = replace(
        _structure([40.0, 40.01], [0.01, 0.01]),
        right=np.repeat(apart.right[:1], 2, axis=0),
        left=np.repeat(apart.left[:1], 2, axis=0),
    )
    assert visibility(apart, 1, axis, everywhere, variance, 2).demanded
    assert not visibility(same, 1, axis, everywhere, variance, 2).demanded
    assert not visibility(apart, 1, axis, everywhere, 1e6 * variance, 2).demanded


TRUE: list[dict[str, Any]] = [
    {"frequency_hz": 100.0, "damping_ratio": 0.01, "demanded": True, "in_pair": True},
    {"frequency_hz": 100.8, "damping_ratio": 0.01, "demanded": True, "in_pair": True},
    {"frequency_hz": 150.0, "damping_ratio": 0.02, "demanded": True},
    {"frequency_hz": 170.0, "damping_ratio": 0.01, "demanded": False},
]


def _score(*modes: FoundMode) -> Any:
    return score({"modes": TRUE}, Answer(modes))


def test_every_mode_is_matched_once() -> None:
    single = _score(FoundMode(100.3, 0.01), FoundMode(100.4, 0.01), FoundMode(150.1, 0.02), FoundMode(170.1, 0.01))
    assert (len(single.matches), single.missed, single.invented) == (3, (), ())
    doubled = _score(FoundMode(150.0, 0.02), FoundMode(150.2, 0.02), FoundMode(60.0, 0.01))
    assert [m["frequency_hz"] for m in doubled.missed] == [100.0, 100.8]
    assert {m.frequency_hz for m in doubled.invented} == {150.2, 60.0}
    assert _score(FoundMode(153.5, 0.02)).invented  # beyond half a bandwidth
    assert _score().demanded == 3


def test_bars_are_held_against_the_errors() -> None:
    match = _score(FoundMode(150.3, 0.022, 0.1, 0.002)).matches[0]
    assert match.frequency_ratio == pytest.approx(3.0)
    assert match.damping_ratio == pytest.approx(1.0)
    assert match.damping == pytest.approx(0.1)
    assert _score(FoundMode(150.3, 0.022)).matches[0].frequency_ratio is None


def test_the_table_counts_failures_as_missed_modes() -> None:
    truth = draw_set(1, 6).truth
    text = report([score(truth, Answer((), "too slow", seconds=9.0))], "title")
    assert "| all | 1 |" in text
    assert "| 0.0 | 0.0 | - |" in text
    assert "Too slow: 1 (6)." in text


def test_stable_poles_are_chosen_and_strays_left() -> None:
    rng = np.random.default_rng(2)
    true = poles_of(np.array([50.0, 50.6, 80.0]), np.array([0.01, 0.012, 0.02]))
    charts = []
    for _ in range(30):
        strays = poles_of(rng.uniform(40, 90, 6), rng.uniform(0.001, 0.1, 6))
        charts.append(OrderPoles(np.concatenate([true * (1 + 1e-4 * rng.standard_normal(3)), strays, true.conj()])))
    modes = choose(charts, (40.0, 90.0))
    assert [mode.frequency_hz for mode in modes] == pytest.approx([50.0, 50.6, 80.0], rel=1e-4)
    assert [mode.damping_ratio for mode in modes] == pytest.approx([0.01, 0.012, 0.02], rel=0.02)
    assert len(candidates(charts, (40.0, 90.0))) >= 3


def _easy() -> Problem:
    axis = np.arange(1, 401) * 0.25
    clean = _structure([40.0, 70.0], [0.01, 0.015], seed=4).frf(axis, 2)
    rng = np.random.default_rng(1)
    noise = rng.standard_normal((2, *clean.shape)) * 0.003 * np.sqrt(np.mean(np.abs(clean) ** 2))
    labels = ("A:+X", "B:+X", "C:+X"), ("A:+X", "D:+X")
    return Problem(axis, clean + noise[0] + 1j * noise[1], "accelerance", (25.0, 90.0), *labels)


def test_an_engine_answers_within_limits() -> None:
    with running("ours", Limits(seconds=100.0)) as engine:
        result = engine.ask(_easy())
        assert result.status == "ok"
        modes = [{"frequency_hz": f, "damping_ratio": z, "demanded": True} for f, z in ((40.0, 0.01), (70.0, 0.015))]
        single = score({"modes": modes}, result)
        assert (len(single.matches), len(single.invented)) == (2, 0)
        assert max(abs(m.frequency) for m in single.matches) < 1e-3
        assert result.peak_mb > result.base_mb > 20
        short = replace(engine, limits=Limits(seconds=0.01))
        assert short.ask(_easy()).status == "too slow"
        small = replace(engine, limits=Limits(megabytes=1.0))
        assert small.ask(_easy()).status in ("failed", "killed")


def test_a_missing_engine_is_told_with_the_remedy() -> None:
    with pytest.raises(ChildProcessError, match="--python"), running("no such engine", Limits()):
        pass
