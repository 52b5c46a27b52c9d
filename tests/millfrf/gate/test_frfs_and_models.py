"""FRFs and models that cannot be: another sign convention, exchanged channels, axes out of order, unstable poles."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from estimation import Frf, FrfCovariance, read_frf, to_receptance, write_frf
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core import InputError, write_json
from millfrf.gate import check_frf, check_model, returned_power_sentences, terms_left_out
from modal_fit import ModalModel, read_modal_model, write_modal_model
from replay_data import default_structure, table_one_model, tip_model

AXIS = np.arange(1.0, 60.0, 0.125)
CUT = """[cutting]
teeth = 2
diameter_m = 0.0127
edge_angle_deg = 90.0
ktc_pa = 119e6
krc = 0.17
kac = 0.33
start_angle_deg = 90.0
exit_angle_deg = 180.0
feed_per_tooth_m = 0.00015
"""


def tip_frf(noise: float = 0.01) -> Frf:
    """The tip of the simulated cell as a hammer would give it: noise in both parts, and a coherence."""
    exact = tip_model(default_structure()).frf(AXIS)
    size = np.abs(exact.values).max(axis=(1, 2))
    rng = np.random.default_rng(5)
    error = rng.standard_normal((2, *exact.values.shape)) * noise * size[:, None, None]
    spread = np.eye(3)[None] * (noise * size[:, None, None]) ** 2 * 2
    covariance = FrfCovariance(spread.astype(complex), np.repeat(np.eye(3)[None], len(AXIS), axis=0).astype(complex))
    return replace(
        exact,
        values=exact.values + error[0] + 1j * error[1],
        multiple_coherence=np.full((len(AXIS), 3), 0.99),
        covariance=covariance,
    )


def unsorted(frf: Frf) -> Frf:
    order = np.r_[0:100, 101, 100, 102 : len(AXIS)]
    return replace(frf, frequencies=frf.frequencies[order])


def with_coherence(value: float) -> Callable[[Frf], Frf]:
    return lambda frf: replace(frf, multiple_coherence=np.full((len(AXIS), 3), value))


def flipped(rows: list[float]) -> Callable[[Frf], Frf]:
    return lambda frf: replace(frf, values=frf.values * np.array(rows)[:, None])


def exchanged(frf: Frf) -> Frf:
    """Force and motion under each other's names: the inverse."""
    return replace(frf, values=np.linalg.inv(frf.values), covariance=None)


REFUSED: dict[str, tuple[Callable[[Frf], Frf], str]] = {
    "exp(-iwt)": (lambda frf: replace(frf, values=frf.values.conj()), "conjugate the values"),
    "all zero": (lambda frf: replace(frf, values=0 * frf.values), "every value is zero"),
    "no valid line": (lambda frf: replace(frf, valid=np.zeros(len(AXIS), dtype=bool)), "no line is valid"),
    "negative frequencies": (lambda frf: replace(frf, frequencies=frf.frequencies - 10), "frequencies begin at -9 Hz"),
    "NaN frequencies": (lambda frf: replace(frf, frequencies=frf.frequencies * np.nan), "not finite"),
    "out of order": (unsorted, "frequencies do not increase (13.625 Hz is followed by 13.5 Hz)"),
    "coherence of 5": (with_coherence(5.0), "a multiple coherence is 5"),
    "coherence below 0": (with_coherence(-0.2), "a multiple coherence is -0.2"),
    "coherence NaN": (with_coherence(np.nan), "a multiple coherence is nan"),
    "one sign wrong": (flipped([1, -1, 1]), "TCP:+Y moves against its own force"),
    "all signs wrong": (flipped([-1, -1, -1]), "moves against its own force"),
    "force and motion exchanged": (exchanged, "exchange force and response"),
}


@pytest.fixture
def cut(tmp_path: Path) -> str:
    path = tmp_path / "cut.toml"
    path.write_text(CUT, encoding="utf-8")
    return str(path)


def commands(file: Path, cut: str, out: Path) -> dict[str, list[str]]:
    speeds = ["--speeds", "600", "1200", "4", "--max-depth", "0.005"]
    return {
        "lobes": ["lobes", str(file), "--cutting", cut, *speeds, "--method", "zero-order", "--out", str(out / "l.csv")],
        "fit": ["fit", str(file), "--band", "13", "25", "--out", str(out / "m.json")],
    }


@pytest.mark.parametrize("verb", ["lobes", "fit"])
@pytest.mark.parametrize("name", REFUSED)
def test_an_frf_that_cannot_be_is_refused_in_one_line(
    name: str, verb: str, cut: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, message = REFUSED[name]
    write_frf(tmp_path / "frf.h5", change(tip_frf()))
    assert run(commands(tmp_path / "frf.h5", cut, tmp_path)[verb]) == BAD_INPUT
    said = capsys.readouterr().err
    assert message in said
    assert "frf.h5" in said
    assert said.count("\n") == 1
    assert not list(tmp_path.glob("*.csv")) + list(tmp_path.glob("m.json"))


def test_nan_lines_are_refused_where_they_are_read(
    cut: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_frf(tmp_path / "frf.h5", tip_frf())
    with h5py.File(tmp_path / "frf.h5", "r+") as file:
        file["values"][40] = np.nan
        del file.attrs["content_sha256"]
    assert run(commands(tmp_path / "frf.h5", cut, tmp_path)["lobes"]) == BAD_INPUT
    assert "NaN or infinity at 6 Hz" in capsys.readouterr().err


@pytest.mark.parametrize("quantity", ["receptance", "mobility", "accelerance"])
def test_the_convention_is_told_in_every_quantity(quantity: str) -> None:
    power = {"receptance": 0, "mobility": 1, "accelerance": 2}[quantity]
    exact = tip_frf()
    frf = replace(exact, values=exact.values * (2j * np.pi * AXIS[:, None, None]) ** power, quantity=quantity)
    np.testing.assert_allclose(to_receptance(frf).values, exact.values)
    assert check_frf(frf) == []
    with pytest.raises(InputError, match="conjugate the values"):
        check_frf(replace(frf, values=frf.values.conj()))


def test_the_convention_is_told_away_from_the_drive_point() -> None:
    far = replace(tip_frf(), responses=("A:+X", "A:+Y", "A:+Z"))
    assert check_frf(far) == []
    with pytest.raises(InputError, match="conjugate the values"):
        check_frf(replace(far, values=far.values.conj()))


def test_swapped_axes_are_doubted_and_the_doubt_travels(
    cut: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    right = tip_frf()
    swapped = replace(right, values=right.values[:, [1, 0, 2]])
    write_frf(tmp_path / "frf.h5", swapped)
    for command in commands(tmp_path / "frf.h5", cut, tmp_path).values():
        assert run(command) == DONE
        assert "warning" in (said := capsys.readouterr().err)
        assert "TCP gives back" in said
    stored = json.loads((tmp_path / "m.json").read_text(encoding="utf-8"))["provenance"]["warnings"]
    assert any("TCP gives back" in text for text in stored)


@pytest.mark.parametrize("turned", [1.0, -1.0])
def test_exchanged_responses_are_named(turned: float) -> None:
    right = tip_frf()
    exchanged = right.values[:, [1, 0, 2]] * np.array([1.0, turned, 1.0])[:, None]
    [sentence] = returned_power_sentences(replace(right, values=exchanged))
    assert "with the responses along X and Y exchanged" in sentence
    assert ("turned" in sentence) == (turned < 0)
    assert returned_power_sentences(right) == []


def test_a_direction_that_counts_against_its_axis_is_no_fault() -> None:
    right = tip_frf()
    assert check_frf(replace(right, values=-right.values, responses=("TCP:-X", "TCP:-Y", "TCP:-Z"))) == []


def unstable(model: ModalModel) -> ModalModel:
    poles = model.poles.copy()
    poles[1] = -poles[1].conj()
    return replace(model, poles=poles)


MODELS: dict[str, tuple[Callable[[ModalModel], ModalModel], str]] = {
    "unstable pole": (unstable, "has a damping ratio of -9.96 %: it is unstable by itself"),
    "no mode": (
        lambda m: replace(m, poles=m.poles[:0], right=m.right[:0], left=m.left[:0]),
        "has no mode; fit it in a band that holds one",
    ),
    "residues of the wrong sign": (lambda m: replace(m, right=-m.right), "moves against its own force"),
    "vectors of zero": (lambda m: replace(m, right=0 * m.right), "every value is zero"),
}


def test_a_drive_point_whose_motion_comes_before_its_force_is_no_sign_convention() -> None:
    """It was said that the values stand for exp(-i w t), and conjugated values would have been wrong as well."""
    frf = tip_frf(noise=0.0)
    values = frf.values.copy()
    values[:, 1, 1] = 30 * values[:, 1, 1].conj()
    with pytest.raises(InputError, match=r"the phase of TCP:\+Y / TCP:\+Y rises .*force and response") as caught:
        check_frf(replace(frf, values=values))
    assert "conjugate" not in str(caught.value)


@pytest.mark.parametrize("name", MODELS)
def test_a_model_that_cannot_be_is_refused(
    name: str, cut: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, message = MODELS[name]
    write_modal_model(tmp_path / "model.json", change(table_one_model()))
    assert run(commands(tmp_path / "model.json", cut, tmp_path)["lobes"]) == BAD_INPUT
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1


def test_a_poor_fit_is_doubted_wherever_its_model_goes(
    cut: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "model.json"
    write_modal_model(path, table_one_model())
    content = json.loads(path.read_text(encoding="utf-8"))
    content["provenance"] = {"step": "fit", "reduced_chi_square": 7.3, "relative_error": [[0.4]], "warnings": ["odd"]}
    write_json(path, content)
    assert run(commands(path, cut, tmp_path)["lobes"]) == DONE
    said = capsys.readouterr().err
    assert "warning: model.json: the misfit is 7.3 times what the noise explains" in said
    assert "warning: model.json: an entry of the FRF is fitted to 40 % only" in said
    assert "warning: model.json: odd" in said


def test_sound_structures_are_not_doubted() -> None:
    for model in (table_one_model(), default_structure(), tip_model(default_structure())):
        assert check_model(model) == []
        assert check_frf(model.frf(AXIS)) == []
    assert check_frf(tip_frf()) == []


def test_files_keep_what_was_judged(tmp_path: Path) -> None:
    write_frf(tmp_path / "frf.h5", replace(tip_frf(), band=(13.0, 30.0)))
    assert read_frf(tmp_path / "frf.h5").band == (13.0, 30.0)
    write_modal_model(tmp_path / "m.json", replace(table_one_model(), band=(13.0, 25.0)))
    assert read_modal_model(tmp_path / "m.json").band == (13.0, 25.0)


def test_terms_that_lobes_leave_out_are_told(tmp_path: Path) -> None:
    model = replace(table_one_model(), physics=({"name": "free_form", "location": {}, "parameters": {}},))
    assert terms_left_out(table_one_model()) == []
    (said,) = terms_left_out(model, "improved_model.json")
    assert said.startswith("improved_model.json holds terms of a diagnosis (free_form), which only millfrf predict")


def test_the_motion_is_judged_in_the_band_that_is_used() -> None:
    """A tap on a spindle, as receptance: 1 Hz holds the error of a double integration, of 12 mm/N."""
    frequencies = np.arange(1.0, 3501.0)
    values = 2e-8 / (1 - (frequencies / 1072) ** 2 + 0.066j * frequencies / 1072)
    values[0] = 0.012
    point = ("TCP:+X",)
    frf = Frf(frequencies, values[:, None, None], point, point, "receptance", "m/N", frequencies > 0)
    assert any("TCP moves 0.012 m/N at 1 Hz" in warning for warning in check_frf(frf))
    assert check_frf(frf, band=(300.0, 3500.0)) == []
