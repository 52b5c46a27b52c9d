"""Bases identified from taps on blanks: exact without noise, with right error bars, and refused where they are open."""

import numpy as np
import pytest
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Complex, InputError
from modal_fit import Base, Tool, ToolTable, identify_base, predict_tip, taps_of_blanks
from modal_fit.substructures.assembly import free_tool

AXIS = np.linspace(60.0, 4000.0, 250)
CARBIDE = {"youngs_modulus_pa": 580e9, "density_kg_per_m3": 14500.0, "poissons_ratio": 0.22, "loss_factor": 0.002}
BOTH = ("TCP", "MID")


def tool(name: str, *segments: dict[str, object], **points: float) -> Tool:
    """A carbide tool."""
    described = [{"material": "carbide", "diameter_m": 0.012, **each} for each in segments]
    table = {"material": {"carbide": CARBIDE}, "segment": described, "distance_from_tip_m": points}
    return Tool(name, ToolTable.model_validate(table))


CERTAIN = {"youngs_modulus_std_share": 0.0, "density_std_share": 0.0}
LONG = tool("long", {"length_m": 0.09}, TCP=0.0, MID=0.05)
SHORT = tool("short", {"length_m": 0.06}, TCP=0.0, MID=0.04)
NEW = tool("new", {"length_m": 0.03}, {"length_m": 0.045, "fluted": True}, TCP=0.0)


def base_receptance(s: Complex) -> Complex:
    """Four modes of a base over deflection and rotation."""
    receptance = np.zeros((len(s), 2, 2), dtype=complex)
    modes = ((700, 0.03, (1.2, 4)), (1500, 0.03, (1, -9)), (2600, 0.04, (0.8, 14)), (6000, 0.05, (2, 60)))
    for natural, damping, shape in modes:
        w = 2 * np.pi * natural
        receptance += np.outer(shape, shape) / (w**2 + s**2 + 2 * damping * w * s)[:, None, None]
    return receptance


def tapped(
    blank: Tool,
    responses: tuple[str, ...] = BOTH,
    excitations: tuple[str, ...] = BOTH,
    noise: float = 0.0,
    seed: int = 0,
    compliance: tuple[complex, complex] = (0j, 0j),
    time_constant: float | None = None,
) -> Frf:
    """Receptances of a blank. ``noise``: over the largest direct one at the tip."""
    names = tuple(blank.table.distance_from_tip_m)
    s = 2j * np.pi * AXIS + (0.0 if time_constant is None else 1 / time_constant)
    motion = free_tool(blank, names, s, np.array(compliance)).on_base(base_receptance(s))
    rng, places = np.random.default_rng(seed), tuple(f"{name}:+X" for name in names)
    level, taps = max(noise, 1e-12) * np.abs(motion[:, 0, 0]).max(), 50
    parts = rng.standard_normal((2, *motion.shape)) * level / np.sqrt(2)
    values = motion + parts[0] + 1j * parts[1]
    # the coherence of that many averages that states this variance
    coherence = 1 / (1 + (taps - 1) * level**2 / np.abs(values) ** 2)
    rows, columns = ([names.index(name) for name in side] for side in (responses, excitations))
    kept = np.ix_(range(len(AXIS)), rows, columns)
    return Frf(
        AXIS, values[kept], tuple(places[k] for k in rows), tuple(places[k] for k in columns), "receptance", "m/N",
        AXIS > 0, coherence=coherence[kept], averages=np.full((len(rows), len(columns)), taps),
        exponential_time_constant=time_constant,
    )  # fmt: skip


def identified(*blanks: tuple[Tool, Frf]) -> Base:
    """The base of blanks with their FRFs."""
    return identify_base(taps_of_blanks([tool for tool, _ in blanks], [frf for _, frf in blanks]).taps)


def certain(described: Tool) -> Tool:
    """The tool without errors of its description."""
    exact = {**described.table.model_dump(), "stickout_std_m": 0.0, "material": {"carbide": CARBIDE | CERTAIN}}
    return Tool(described.name, ToolTable.model_validate(exact))


def numbers_of(receptance: Complex) -> NDArray[np.complex128]:
    """H, L and P of each line."""
    return receptance.reshape(-1, 4)[:, [0, 1, 3]]


@pytest.mark.parametrize("time_constant", [None, 0.02])
def test_without_noise_the_base_is_found_and_the_tip_predicted(time_constant: float | None) -> None:
    long = certain(LONG)
    collected = taps_of_blanks([long], [tapped(long, time_constant=time_constant)])
    base = identify_base(collected.taps)
    s = collected.taps.s
    truth = numbers_of(base_receptance(s))
    assert np.abs(base.lines["X"].numbers / truth - 1).max() < 1e-4
    new = Tool("new", NEW.table.model_copy(update={"material": long.table.material}))
    tip = predict_tip(base, new, collected.frequencies, collected.time_constant).frf
    expected = free_tool(NEW, ("TCP",), s, np.zeros(2)).on_base(base_receptance(s))
    assert np.abs(tip.values / expected - 1).max() < 1e-4
    assert tip.exponential_time_constant == time_constant
    assert "only one blank" in base.doubts()[0]


def test_error_bars_of_base_and_tip_hold() -> None:
    squares, tips = [], []
    expected = free_tool(NEW, ("TCP",), 2j * np.pi * AXIS, np.zeros(2)).on_base(base_receptance(2j * np.pi * AXIS))
    for seed in range(4):
        frfs = [tapped(blank, noise=3e-4, seed=10 * seed + number) for number, blank in enumerate((LONG, SHORT))]
        collected = taps_of_blanks([LONG, SHORT], frfs)
        base = identify_base(collected.taps)
        assert 0.85 < base.chi_square < 1.15
        assert not base.doubts()
        lines = base.lines["X"]
        off = lines.numbers - numbers_of(base_receptance(collected.taps.s))
        squares.append(np.abs(off) ** 2 / np.einsum("njj->nj", lines.covariance).real)
        tip = predict_tip(base, NEW, collected.frequencies, None)
        tips.append(np.abs(tip.frf.values - expected)[:, 0, 0] ** 2 / tip.frf.total_variance()[:, 0, 0])  # type: ignore[index]
    assert 0.8 < np.median(squares) / np.log(2) < 1.25  # exponential distribution
    assert np.mean(np.array(tips) < 3.0) > 0.9


def test_two_lengths_with_tip_and_cross_receptance_determine_the_base() -> None:
    two = enumerate(map(certain, (LONG, SHORT)))
    blanks = [(each, tapped(each, excitations=("TCP",), noise=1e-5, seed=seed)) for seed, each in two]
    lines = identified(*blanks).lines["X"]
    off = np.abs(lines.numbers - numbers_of(base_receptance(2j * np.pi * AXIS))) ** 2
    assert 0.8 < np.median(off / np.einsum("njj->nj", lines.covariance).real) / np.log(2) < 1.25


def test_a_tip_alone_does_not_determine_the_base() -> None:
    with pytest.raises(InputError, match="do not determine how the base turns"):
        identified(*((each, tapped(each, ("TCP",), ("TCP",))) for each in (LONG, SHORT)))


HOLDER = {"length_m": 0.02, "diameter_m": 0.036}
CLAMPED = tool("clamped", HOLDER, {"length_m": 0.07, "contact": True}, TCP=0.0, MID=0.03, NOSE=0.07, HOLD=0.09)


def test_a_contact_is_found_with_its_error_bars() -> None:
    true = (1 / (8e7 * (1 + 0.05j)), 1 / (3e4 * (1 + 0.08j)))
    every = tuple(CLAMPED.table.distance_from_tip_m)
    frf = tapped(CLAMPED, every, every, 3e-4, 1, true)
    base = identified((CLAMPED, frf))
    compliance, errors = base.compliances()
    assert (np.abs(compliance.real - np.real(true)) < 4 * errors).all()
    assert (errors < 0.03 * np.real(true)).all()
    new = tool("new", HOLDER, {"length_m": 0.05, "contact": True}, TCP=0.0)
    tip = predict_tip(base, new, AXIS, None)
    expected = free_tool(new, ("TCP",), 2j * np.pi * AXIS, np.array(true)).on_base(base_receptance(2j * np.pi * AXIS))
    off = np.abs(tip.frf.values - expected)[:, 0, 0] / tip.deviation[:, 0]
    assert np.mean(off < 2) > 0.9


def test_a_contact_without_two_points_on_the_holder_is_refused() -> None:
    with pytest.raises(InputError, match="do not tell the contact from the base"):
        identified((CLAMPED, tapped(CLAMPED, (*BOTH, "NOSE"), (*BOTH, "NOSE"), 1e-4)))
    base = identified((LONG, tapped(LONG, noise=1e-4)))
    with pytest.raises(InputError, match="has a contact, but no blank has"):
        predict_tip(base, CLAMPED, AXIS, None)


def test_blanks_that_contradict_each_other_are_doubted() -> None:
    wrong = tool("short", {"length_m": 0.06, "diameter_m": 0.0132}, TCP=0.0, MID=0.04)
    base = identified((LONG, tapped(LONG, noise=3e-4)), (wrong, tapped(SHORT, noise=3e-4, seed=1)))
    assert base.chi_square > 5
    assert "the taps disagree" in base.doubts()[0]


def test_a_prediction_that_is_noise_is_refused() -> None:
    collected = taps_of_blanks([LONG], [tapped(LONG, noise=1.0)])
    with pytest.raises(InputError, match="exceeds it"):
        predict_tip(identify_base(collected.taps), NEW, collected.frequencies, None)


def test_frfs_that_do_not_fit_together_are_refused() -> None:
    with pytest.raises(InputError, match="different exponential windows"):
        taps_of_blanks([LONG, SHORT], [tapped(LONG), tapped(SHORT, time_constant=0.1)])
    lone = tool("lone", {"length_m": 0.09}, OTHER=0.0)
    with pytest.raises(InputError, match="no receptance between points"):
        taps_of_blanks([lone], [tapped(LONG)])
    other = {**LONG.table.model_dump(), "material": {"carbide": CARBIDE | {"youngs_modulus_pa": 2e11}}}
    softer = Tool("soft", ToolTable.model_validate(other))
    with pytest.raises(InputError, match="two tool files have the name long"):
        taps_of_blanks([LONG, LONG], [tapped(LONG), tapped(LONG)])
    with pytest.raises(InputError, match="material 'carbide' differs"):
        predict_tip(identified((LONG, tapped(LONG, noise=1e-4))), softer, AXIS, None)
    with pytest.raises(InputError, match="material 'carbide' differs"):
        taps_of_blanks([LONG, softer], [tapped(LONG), tapped(LONG)])
