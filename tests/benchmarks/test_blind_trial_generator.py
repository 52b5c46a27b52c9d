"""The blind trial's generator: its integrator, its effects, its noise, its seals and its scores."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import lsim

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # benchmarks are no installed package

from acquisition import Recording
from benchmarks.blind_trial import laws
from benchmarks.blind_trial.case_spec import SHARES, CaseSpec, draw_cases, full_grid
from benchmarks.blind_trial.diagnosis_reading import Answer, read_answer
from benchmarks.blind_trial.effects import ALL, FOREIGN, LISTED
from benchmarks.blind_trial.excitation import KEPT, milling_test
from benchmarks.blind_trial.further_groups import DIRECTIONAL, EXTENDED
from benchmarks.blind_trial.integrator import Element, linear_response, respond, tip_motion
from benchmarks.blind_trial.noise import COLOURS, measurement_noise
from benchmarks.blind_trial.scoring import angle_between, excess_removed, outcome_of, score_case, wilson
from benchmarks.blind_trial.sealed_case import case_name, open_truth, write_case
from benchmarks.blind_trial.simulation import build_case
from benchmarks.blind_trial.structures import Structure, draw_structure
from benchmarks.blind_trial.tip_scale import counted_at_tip, scale_at_tip
from millfrf.mismatch import library
from modal_fit import read_modal_model

SPEC = CaseSpec(3, 12345, "main", "none", "none", 0.0, 0.02, "sweeps", 1, 0.0)


def _of(effect: str, strength: float = 2.0, **changes: Any) -> CaseSpec:
    return replace(SPEC, effect=effect, family=ALL[effect].families[0], strength=strength, **changes)


def _one_mode() -> Structure:
    return (
        draw_structure(np.random.default_rng(0))
        .__class__(
            np.empty(0, complex), np.empty((0, 3), complex), np.empty((0, 3), complex), np.empty((0, 3), complex)
        )
        .with_mode(12.0, 0.03, np.array([0.1, 0.0, 0.0]))
    )


def test_no_structure_jumps_and_all_are_damped() -> None:
    for seed in range(30):
        structure = draw_structure(np.random.default_rng(seed))
        jump = 2 * np.real(np.einsum("rp,rq->pq", structure.tip, structure.left))
        assert np.abs(jump).max() < 1e-9 * np.abs(structure.tip).max() * np.abs(structure.left).max() * 1e3
        assert structure.poles.real.max() < 0
        assert 4 <= len(structure.poles) <= 7


@pytest.mark.long
def test_linear_response_agrees_with_scipy_and_with_the_integrator() -> None:
    force = milling_test("mixed", "mid", 40.0, 5, np.random.default_rng(1)).force
    structure = _one_mode()
    omega, zeta, mass = 2 * np.pi * 12, 0.03, 1 / 0.1**2
    system = ([1 / mass, 0.0, 0.0], [1.0, 2 * zeta * omega, omega**2])
    fine = np.arange(len(force) * 32) / (512 * 32)
    smooth = np.fft.irfft(np.fft.rfft(force[:, 0]) * 32, len(fine))
    oracle = lsim(system, smooth, fine)[1][::32]
    exact = linear_response(structure, force)[:, 0]
    assert np.std((exact - oracle)[KEPT]) < 2e-4 * np.std(oracle[KEPT])
    still = Element(laws.VISCOUS, (0.0,), np.array([1.0, 0, 0]), np.array([1.0, 0, 0]))
    stepped = respond(structure, force, [still])[:, 0]
    assert np.std((stepped - exact)[KEPT]) < 1e-5 * np.std(exact[KEPT])


@pytest.mark.long
def test_power_of_the_force_is_stored_and_dissipated() -> None:
    # F v = d/dt (m v^2 / 2 + k u^2 / 2) + c v^2, with the integrator's acceleration
    force = milling_test("porous", "mid", 40.0, 5, np.random.default_rng(2)).force
    axis = np.array([1.0, 0, 0])
    acceleration = respond(_one_mode(), force, [Element(laws.VISCOUS, (0.0,), axis, axis)])[:, 0]
    deflection, speed = tip_motion(_one_mode(), force, axis)
    mass, omega = 100.0, 2 * np.pi * 12
    given = force[:, 0] * speed
    stored = mass * (acceleration + omega**2 * deflection) * speed
    lost = mass * 2 * 0.03 * omega * speed**2
    assert np.std((given - stored - lost)[KEPT]) < 1e-4 * np.std(given[KEPT])
    assert np.sum(given[KEPT]) == pytest.approx(np.sum((stored + lost)[KEPT]), rel=1e-4)


def test_a_spring_among_the_laws_is_a_stiffer_structure() -> None:
    force = milling_test("porous", "mid", 40.0, 5, np.random.default_rng(2)).force
    spring = Element(laws.SCHEDULED, (5e4,), np.array([1.0, 0, 0]), np.array([1.0, 0, 0]), np.ones(len(force)))
    stepped = respond(_one_mode(), force, [spring])[:, 0]
    omega = 2 * np.pi * 12
    stiff = np.sqrt(omega**2 + 5e4 * 0.01)
    ready = Structure(
        np.empty(0, complex), np.empty((0, 3), complex), np.empty((0, 3), complex), np.empty((0, 3), complex)
    ).with_mode(stiff / 2 / np.pi, 0.03 * omega / stiff, np.array([0.1, 0.0, 0.0]))
    exact = linear_response(ready, force)[:, 0]
    assert np.std((stepped - exact)[KEPT]) < 2e-5 * np.std(exact[KEPT])


@pytest.mark.parametrize(
    ("code", "parameters"),
    [(laws.CUBIC, (60.0, 2e-4)), (laws.LUGRE, (30.0, 4e-5, 20.0)), (laws.BOUC_WEN, (2e5, 6e3, 3e3))],
)
def test_nonlinear_march_agrees_with_an_adaptive_solver(code: int, parameters: tuple[float, ...]) -> None:
    n = 1024
    time = np.arange(n) / 512
    pulse = 150 * np.sin(2 * np.pi * 9 * time) * np.sin(np.pi * time / time[-1]) ** 2
    force = np.stack([pulse, 0 * pulse, 0 * pulse], axis=1)
    axis = np.array([1.0, 0, 0])
    ours = respond(_one_mode(), force, [Element(code, parameters, axis, axis)])[:, 0]
    omega, p = 2 * np.pi * 12, np.pad(np.array(parameters), (0, 6 - len(parameters)))

    def rates(t: float, y: NDArray[np.float64]) -> list[float]:
        push = 150 * np.sin(2 * np.pi * 9 * t) * np.sin(np.pi * t / time[-1]) ** 2
        slip = laws.memory_rate(code, p, y[1], y[2])
        law = laws.law_force(code, p, (y[0], y[1], 0.0), np.zeros(8), y[2], slip)
        return [y[1], 0.01 * (push - law) - 0.06 * omega * y[1] - omega**2 * y[0], slip]

    result = solve_ivp(rates, (0, time[-1]), [0, 0, 0], t_eval=time, rtol=1e-9, atol=1e-13, method="LSODA")
    truth = np.array([rates(t, y)[1] for t, y in zip(time, result.y.T, strict=True)])
    assert np.std((ours - truth)[50:-50]) < 3e-3 * np.std(truth)


def test_sliders_remember_and_dissipate() -> None:
    p, z = np.array([1e6, 1e-4, 0, 0, 0, 0]), np.zeros(8)
    path = 3e-4 * np.sin(np.linspace(0, 4 * np.pi, 4000))
    forces = []
    for u in path:
        forces.append(laws.remembering(laws.IWAN, p, u, 0.0, z, 0.0))
        laws.drag_sliders(p, u, z)
    loop = np.trapezoid(np.array(forces[2000:]), path[2000:])
    assert loop > 0
    assert max(forces) == pytest.approx(1e6 * 1e-4, rel=1e-6)  # mean slider yields at p[1]


QUICK = ("backlash", "channel_delay", "dropouts", "missing_mode")


@pytest.mark.long
@pytest.mark.parametrize(
    "effect",
    [*QUICK, *(pytest.param(e, marks=pytest.mark.slow) for e in sorted({**LISTED, **FOREIGN}) if e not in QUICK)],
)
def test_every_effect_reaches_its_strength(effect: str) -> None:
    for family, strength in zip(ALL[effect].families, (0.5, 2.0, 1.0, 5.0), strict=False):
        truth = build_case(replace(_of(effect, strength), family=family)).truth
        assert truth["residual_over_noise"] == pytest.approx(strength, rel=0.3)
        assert truth["residual_after_refit_over_noise"] <= 1.001 * truth["residual_over_noise"]


@pytest.mark.long
def test_a_linear_refit_imitates_a_gain_and_not_a_friction() -> None:
    gain = build_case(_of("gain_error", 5.0)).truth
    friction = build_case(_of("coulomb_friction", 5.0)).truth
    assert gain["residual_after_refit_over_noise"] < 0.05
    assert friction["residual_after_refit_over_noise"] > 0.5


def test_a_clean_exact_case_leaves_nothing_but_noise() -> None:
    truth = build_case(SPEC).truth
    facts = truth["recordings"]["unseen"]
    assert truth["effects"] == []
    assert truth["residual_over_noise"] < 1e-9
    np.testing.assert_allclose(facts["nominal_error_rms"], facts["noise_floor_rms"], rtol=0.05)


@pytest.mark.parametrize("colour", COLOURS)
def test_noise_has_its_share(colour: str) -> None:
    rng = np.random.default_rng(0)
    clean = rng.standard_normal((24576, 3)) * [1.0, 5.0, 20.0] + 3.0
    noise = measurement_noise(clean, 0.03, colour, rng)
    np.testing.assert_allclose(noise.std(axis=0), 0.03 * clean.std(axis=0), rtol=1e-9)


@pytest.mark.long
def test_same_seed_same_case_same_seal(tmp_path: Path) -> None:
    spec = _of("channel_delay")
    each, two = write_case(spec, tmp_path / "one"), write_case(spec, tmp_path / "two")
    assert (each / "seal.json").read_bytes() == (two / "seal.json").read_bytes()
    with Recording(each / "mid.h5") as first, Recording(two / "mid.h5") as second:
        assert first.complete
        assert [c.name for c in first.stream().channels] == ["fx", "fy", "fz", "ax", "ay", "az"]
        np.testing.assert_array_equal(first.stream().read(), second.stream().read())
    assert read_modal_model(each / "nominal.json").responses == ("TCP:+X", "TCP:+Y", "TCP:+Z")
    other = build_case(replace(spec, seed=spec.seed + 1))
    assert not np.allclose(other.recordings["mid"], build_case(spec).recordings["mid"])


def test_a_truth_changed_after_sealing_is_refused(tmp_path: Path) -> None:
    write_case(SPEC, tmp_path)
    name = case_name(SPEC.index)
    truth = open_truth(tmp_path, name)
    sealed = tmp_path / "sealed" / f"{name}.json"
    sealed.write_text(json.dumps({**truth, "effects": ["backlash"]}), encoding="utf-8")
    with pytest.raises(ValueError, match="changed after it had been sealed"):
        open_truth(tmp_path, name)


def test_effects_that_a_tool_may_name_otherwise_are_listed_under_that_name() -> None:
    assert {name: effect.answer for name, effect in FOREIGN.items() if effect.answer} == {
        "square_speed_damping": "quadratic_damping"
    }
    assert set(library()) >= {effect.answer for effect in FOREIGN.values() if effect.answer}


def test_draw_is_stratified_and_repeatable() -> None:
    cases = draw_cases(1000, 4)
    assert cases == draw_cases(1000, 4)
    counts = {group: sum(c.group == group for c in cases) for group in SHARES}
    assert counts["control"] >= 300
    assert {c.effect for c in cases if c.group == "main"} == {*LISTED, "modal_parameters"}
    assert {c.effect for c in cases if c.group == "foreign"} == set(FOREIGN)
    assert len({c.seed for c in cases}) == 1000
    assert len(list(full_grid())) == len({*LISTED, "modal_parameters"}) * 5 * 3 * 3 * 3


def test_older_draws_stay_and_the_extended_one_has_every_group() -> None:
    cases = draw_cases(300, 4, only="extended")
    assert cases == draw_cases(300, 4, only="extended")
    assert {c.group for c in cases} == set(EXTENDED)
    assert {c.effect for c in draw_cases(40, 4, only="inner_joint")} == set(DIRECTIONAL)
    steady = draw_cases(120, 4, only="steady")
    assert sum(c.effect == "none" for c in steady) == 60
    assert {c.excitation for c in steady} == {"constant", "multisine"}


def test_a_multisine_repeats_and_drives_three_axes_apart() -> None:
    force = milling_test("multisine", "mid", 40.0, 5, np.random.default_rng(1)).force[KEPT]
    period = 4 * 512
    blocks = [force[first : first + 4 * period] for first in (0, 16 * 512, 32 * 512)]
    for block in blocks:
        np.testing.assert_allclose(block[period : 2 * period], block[2 * period : 3 * period], atol=1e-9)
    spectra = np.stack([np.fft.rfft(block[period : 2 * period], axis=0)[8:440] for block in blocks], axis=1)
    assert np.linalg.matrix_rank(spectra).min() == 3
    assert np.sqrt(np.mean(force**2)) == pytest.approx(2.2 * 40.0)


def test_a_spring_inside_the_structure_is_a_stiffer_structure() -> None:
    """``K + k psi psi^T``, solved apart, answers as the march does with a spring at the inner joint."""
    structure = draw_structure(np.random.default_rng(8), inner_joint=True)
    assert structure.inner is not None
    force = milling_test("porous", "mid", 40.0, 5, np.random.default_rng(2)).force
    axis = np.array([0.0, 0, 0, 1])
    stiffness = 0.1 * abs(structure.static_stiffness(axis))
    spring = Element(laws.SCHEDULED, (stiffness,), axis, axis, np.ones(len(force)))
    stepped = respond(structure, force, [spring])
    s = 2j * np.pi * np.fft.rfftfreq(1 << 16, 1 / 512)

    def transfer(right: NDArray[np.complex128], left: NDArray[np.complex128]) -> NDArray[np.complex128]:
        direct = np.einsum("kr,rp,rq->kpq", 1 / (s[:, None] - structure.poles), right, left, optimize=True)
        other = 1 / (s[:, None] - structure.poles.conj())
        return np.asarray(direct + np.einsum("kr,rp,rq->kpq", other, right.conj(), left.conj(), optimize=True))

    right, left = structure.inner[0][:, None], structure.inner[1][:, None]
    here = transfer(right, left)
    held = transfer(structure.tip, structure.left)
    held = held - transfer(structure.tip, left) @ transfer(right, structure.left) * stiffness / (1 + stiffness * here)
    spectrum = (s**2)[:, None] * (held @ np.fft.rfft(force, 1 << 16, axis=0)[:, :, None])[:, :, 0]
    exact = np.fft.irfft(spectrum, 1 << 16, axis=0)[: len(force)]
    moved = np.std((linear_response(structure, force) - exact)[KEPT])
    assert np.std((stepped - exact)[KEPT]) < 1e-3 * moved


@pytest.mark.long
def test_a_small_mode_may_be_named_beside_the_effect() -> None:
    truth = build_case(_of("coulomb_friction", 5.0, condition="small_mode")).truth
    assert truth["effects"] == ["coulomb_friction"]
    assert outcome_of(truth, Answer("explained", ("coulomb_friction", "missing_mode"))) == "right"
    assert outcome_of(truth, Answer("explained", ("missing_mode",))) == "wrong"


def test_missing_channel_level_and_sensor_away(tmp_path: Path) -> None:
    case = build_case(replace(SPEC, condition="level_missing"))
    assert len(case.recordings) == 3
    assert "unseen" in case.recordings
    folder = write_case(replace(SPEC, condition="channel_missing"), tmp_path)
    with Recording(folder / "low.h5") as recording:
        assert len(recording.stream().channels) == 5
    away = build_case(replace(SPEC, condition="sensor_away"))
    assert away.node == "HEAD"
    assert away.nominal.responses[0] == "HEAD:+X"


def _truth(*effects: str, off: float = 1.0, also: tuple[str, ...] = ()) -> dict[str, Any]:
    return {"effects": list(effects), "accepted_also": list(also), "spec": {"nominal_off": off}}


@pytest.mark.parametrize(
    ("truth", "answer", "outcome"),
    [
        (_truth("backlash"), Answer("explained", ("backlash",)), "right"),
        (_truth("backlash"), Answer("explained", ("backlash", "modal_parameters")), "right"),
        (_truth("backlash", off=0.0), Answer("explained", ("backlash", "modal_parameters")), "wrong"),
        (_truth("backlash"), Answer("explained", ("hysteresis",), ("backlash",)), "equivalent"),
        (_truth("backlash"), Answer("explained", ("hysteresis",)), "wrong"),
        (_truth("backlash"), Answer("unexplained"), "abstained"),
        (_truth("backlash", "clipping"), Answer("explained", ("clipping",)), "partial"),
        (_truth("unexplained"), Answer("unexplained"), "right"),
        (_truth("unexplained"), Answer("none"), "abstained"),
        (_truth("unexplained"), Answer("explained", ("backlash",)), "wrong"),
        (_truth(), Answer("none"), "right"),
        (_truth(), Answer("unexplained"), "wrong"),
        (_truth(), Answer("explained", ("modal_parameters",)), "wrong"),
        (_truth(also=("missing_mode",)), Answer("explained", ("missing_mode",)), "right"),
        (_truth(), Answer("failed"), "failed"),
    ],
)
def test_outcomes(truth: dict[str, Any], answer: Answer, outcome: str) -> None:
    assert outcome_of(truth, answer) == outcome


def test_reading_direction_interval_and_improvement(tmp_path: Path) -> None:
    cause = {"name": "channel_delay", "location": {"direction": [0, 0, 2.0]}}
    cause |= {"parameters": {"delay_s": 1e-3}, "standard_errors": {"delay_s": 1e-5}}
    content = {"verdict": "explained", "physics": [cause], "equivalents": ["ac_coupling"]}
    content["improvement"] = {"error_before": 5.0, "error_after": 1.4, "noise_floor": 1.0}
    (tmp_path / "diagnosis.json").write_text(json.dumps(content), encoding="utf-8")
    answer = read_answer(tmp_path / "diagnosis.json")
    assert answer.direction is not None
    assert angle_between(answer.direction, np.array([0, 0, -1.0])) == pytest.approx(0)
    assert answer.parameters == (("delay_s", 1e-3, 1e-5),)
    assert answer.removed == pytest.approx(0.9)
    assert read_answer(tmp_path / "nothing.json").verdict == "failed"


def test_an_interval_is_held_against_the_nearest_number_of_its_kind() -> None:
    """A mode at 7 Hz and a tone at 17 Hz, both told as frequencies, and the tone's harmonic that was not counted."""
    truth = _truth("missing_mode", "unmeasured_excitation")
    truth.update(parameters=[{"fn": 7.0, "zeta": 0.03}, {"hz": 17.0}], joint_direction_at_tcp=None)
    truth.update(residual_over_noise=2.0, residual_after_refit_over_noise=2.0)
    stated = (("frequency_hz", 7.1, 0.01), ("damping_ratio", 0.031, 0.001), ("frequency_hz", 17.001, 0.001))
    answer = Answer(
        "explained", ("missing_mode", "unmeasured_excitation"), (), None, (*stated, ("frequency_hz", 34, 1))
    )
    score = score_case("case", truth, answer, {"seconds": 1.0})
    assert score.covered == (("fn", False), ("zeta", True), ("hz", True))


def test_numbers_of_a_joint_inside_are_counted_in_the_motion_of_the_tip() -> None:
    """A joint that moves 3 times as much as the tip: its gap is as much smaller there, and its force larger."""
    structure = draw_structure(np.random.default_rng(4), inner_joint=True)
    along = 3 * np.array([0.6, 0.0, 0.8])
    tripled = replace(structure, inner=np.stack([structure.tip @ along, structure.left @ along]))
    assert scale_at_tip(tripled) == pytest.approx(3.0)
    (spec,) = draw_cases(1, 5, only="inner_joint")
    own = scale_at_tip(draw_structure(np.random.default_rng(spec.seed), inner_joint=True))
    (stated,) = counted_at_tip(spec.to_json(), [{"half_gap": 1e-4, "stiffness_loss": 3e4}])
    assert stated == pytest.approx({"half_gap": 1e-4 / own, "stiffness_loss": 3e4 * own**2})
    elsewhere = replace(spec, condition="standard").to_json()
    assert counted_at_tip(elsewhere, [{"half_gap": 1e-4}]) == [{"half_gap": 1e-4}]


def test_excess_and_wilson() -> None:
    truth = {"recordings": {"unseen": {"noise_floor_rms": [1.0, 2.0, 1.0]}}}
    errors = {"columns": [0, 1], "nominal": [3.0, 6.0], "improved": [1.2, 2.4]}
    assert excess_removed(errors, truth) == pytest.approx(0.9)
    assert excess_removed(None, truth) is None
    low, high = wilson(0, 300)  # Wilson 1927, z^2 / (n + z^2) at none of 300
    assert low == 0
    assert high == pytest.approx(1.96**2 / (300 + 1.96**2))
