"""Rigs that are driven with volts, moments or their base, and that answer with angles: units follow, nonsense goes."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from one_mode_rig import Real, Rig, written

from estimation import BandRecording
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core import InputError
from millfrf.mismatch import diagnose, improved_model_of, library, predict, rig_of, tip_axes
from millfrf.mismatch.physics.library import offered
from millfrf.mismatch.records.reading import in_deflections
from modal_fit import ModalModel, Residuals, read_modal_model, write_modal_model

BAND = (4.0, 22.0)


def files_of(folder: Path, rig: Rig, unit: str, levels: tuple[float, ...] = (20.0, 40.0, 60.0)) -> list[str]:
    """Model and recordings of a rig, for the command line."""
    quantity = "receptance" if unit == "m/N" else "transfer"
    write_modal_model(folder / "model.json", replace(rig.model, quantity=quantity, unit=unit, band=BAND))
    return [str(folder / "model.json"), *(str(written(folder, each)) for each in rig.recordings(levels))]


@pytest.mark.long
@pytest.mark.parametrize(
    ("excitation", "response", "unit", "number", "spared"),
    [
        ("moment", "angular_velocity", "rad/N m", "force_at_1mrad_nm", ""),
        ("voltage", "displacement", "m/V", "force_at_1mm_v", "dynamometer dynamics"),
        ("acceleration", "displacement", "m/m/s^2", "force_at_1mm_m_per_s2", "dynamometer dynamics"),
        ("force", "velocity", "m/N", "force_at_1mm_n", ""),
    ],
)
def test_hardening_is_told_in_the_units_of_the_rig(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    excitation: str,
    response: str,
    unit: str,
    number: str,
    spared: str,
) -> None:
    """A cubic spring of 15 % on a rig of each kind, by the command line; the improved model predicts."""
    rig = Rig(excitation=excitation, response=response).stiffened(0.15, 60.0)
    files = files_of(tmp_path, rig, unit)
    assert run(["diagnose", *files, "--out", str(tmp_path / "out")]) == DONE
    said = capsys.readouterr().out
    stored = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert stored["verdict"] == "explained", said
    assert [cause["name"] for cause in stored["physics"]] == ["stiffness_hardening"]
    law = stored["physics"][0]["parameters"]
    assert law["exponent"] == pytest.approx(3.0, abs=0.15)
    assert law[number] == pytest.approx(rig.cubic * 1e-9, rel=0.3), law
    assert any(spared in each for each in stored["not_asked_for"]) or not spared
    page = (tmp_path / "out" / "report.html").read_text()
    assert number in page
    assert (spared[1:] in page.split("Not asked for", 1)[-1]) or not spared
    improved = tmp_path / "out" / "improved_model.json"
    assert read_modal_model(improved).unit == unit
    assert run(["predict", str(improved), files[-1], "--out", str(tmp_path / "p.h5")]) == DONE
    off = float(capsys.readouterr().out.split("all responses: ")[1].split(" %")[0])
    assert off < 4.0


def relative_to_base(rig: Rig, sign: float) -> tuple[ModalModel, list[BandRecording]]:
    """A rig on a shaken base, ``x'' + 2 z w x' + w^2 x + ... = sign a``: -1 where both count positive the same way."""
    model = replace(rig.model, left=sign * rig.model.left, quantity="transfer", unit="m/m/s^2", band=BAND)
    return model, [replace(each, force=sign * each.force) for each in rig.recordings((20.0, 40.0, 60.0))]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_base_pushes_along_the_motion_that_it_causes(sign: float) -> None:
    """A spring between mass and base restores, whichever way the base's acceleration is counted; a force has a sign."""
    model, _ = relative_to_base(Rig(excitation="acceleration"), sign)
    assert tip_axes(model)[1] == [[sign]]
    assert tip_axes(replace(model, quantity="receptance", unit="m/N"))[1] == [[1.0]]


@pytest.mark.long
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_hardening_spring_on_a_base_hardens(sign: float) -> None:
    rig = Rig(excitation="acceleration", response="displacement").stiffened(0.3, 60.0)
    model, recordings = relative_to_base(rig, sign)
    diagnosis = diagnose(model, recordings)
    assert [cause.name for cause in diagnosis.physics] == ["stiffness_hardening"]
    assert predict(improved_model_of(diagnosis), recordings[-1]).total_error < 0.03


@pytest.mark.long
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_pendulum_on_a_base_softens(sign: float) -> None:
    """Its spring is known by its cubic term alone: neither a knee nor the stiffness beyond it is determined."""
    rig = Rig(excitation="acceleration", response="displacement").stiffened(-0.02, 60.0)
    model, recordings = relative_to_base(rig, sign)
    diagnosis = diagnose(model, recordings)
    assert diagnosis.verdict == "explained"
    assert [cause.name for cause in diagnosis.physics] == ["stiffness_softening"]
    assert predict(improved_model_of(diagnosis), recordings[-1]).total_error < 0.03


def test_a_model_of_accelerations_per_volt_becomes_one_of_deflections() -> None:
    """Against the receptance from which it was made, inside its band."""
    plain = Rig().model
    order2 = replace(
        plain,
        right=plain.right * plain.poles[:, None] ** 2,
        residuals=Residuals(np.array([[0.05]]), np.zeros((1, 1))),
        quantity="transfer",
        unit="m/s^2/V",
        band=BAND,
        delay=2e-3,
    )
    result, frequencies = in_deflections(order2), np.linspace(*BAND, 50)
    assert (result.unit, result.delay) == ("m/V", 2e-3)
    s = 2j * np.pi * frequencies
    wanted = order2.receptance(frequencies) / s[:, None, None] ** 2
    size = np.abs(wanted).max()
    np.testing.assert_allclose(result.receptance(frequencies), wanted, atol=0.01 * size)


def later(signal: Real, samples: float) -> Real:
    """A signal some samples later, by a padded Fourier transform."""
    n = 2 * len(signal)
    turn = np.exp(-2j * np.pi * np.fft.rfftfreq(n) * samples)[:, None]
    return np.asarray(np.fft.irfft(np.fft.rfft(signal, n=n, axis=0) * turn, n=n, axis=0)[: len(signal)])


def test_a_delay_of_the_chain_is_no_mismatch_and_stays_in_the_model() -> None:
    rig = Rig(excitation="voltage", response="displacement")
    late, shift = rig.recordings((20.0, 60.0)), 0.03
    late = [replace(each, response=later(each.response, shift * rig.rate)) for each in late]
    model = replace(rig.model, quantity="transfer", unit="m/V", band=BAND, delay=shift)
    diagnosis = diagnose(model, late)
    assert diagnosis.verdict == "none", [cause.name for cause in diagnosis.physics]
    assert diagnosis.details.delay == shift
    assert predict(model, late[1]).total_error < 0.05
    assert predict(replace(model, delay=0.0), late[1]).total_error > 0.5


def transfer(unit: str, labels: tuple[str, ...] = ("TCP:+X",), lower: float = 0.0) -> ModalModel:
    model, n = Rig().model, len(labels)
    return ModalModel(
        model.poles,
        np.tile(model.right, (1, n)),
        np.tile(model.left, (1, n)),
        labels,
        labels,
        "transfer",
        unit,
        Residuals(np.zeros((n, n)), lower * np.eye(n)),
    )


def test_causes_without_a_meaning_are_not_offered() -> None:
    xyz = ("TCP:+X", "TCP:+Y", "TCP:+Z")
    volts, notes = offered(library(), transfer("m/V", xyz))
    gone = set(library()) - set(volts)
    assert gone == {
        "axis_misalignment",
        "cross_talk",
        "dynamometer_axes",
        "dynamometer_dynamics",
        "dynamometer_table_inertia",
        "gyroscopic_coupling",
        "non_proportional_damping",
    }
    assert any("voltage" in note for note in notes)
    base, notes = offered(library(), transfer("m/m/s^2", xyz, lower=1.0))
    assert not any(hasattr(each, "starts") for each in base.values())
    assert any("motion of the base" in note for note in notes)
    assert "coulomb_friction" in offered(library(), transfer("m/m/s^2", xyz))[0]
    askew = replace(transfer("rad/N m"), excitations=("TCP:+RZ",))
    assert any("no response lies along" in note for note in offered(library(), askew)[1])
    usual, notes = offered(library(), replace(transfer("m/N", xyz), quantity="receptance"))
    assert usual == library()
    assert notes == ()


def test_units_of_numbers() -> None:
    moments, _ = offered(library(), transfer("rad/N m"))
    stated = {each.name: each.unit for physics in moments.values() for each in physics.parameters}
    assert stated["friction_nm"] == "N m"
    assert stated["stiffness_nm_per_rad"] == "N m/rad"
    assert stated["smooth_velocity_rad_per_s"] == "rad/s"
    assert stated["half_gap_rad"] == "rad"
    assert stated["damping_nm_s2_per_rad2"] == "N m s^2/rad^2"
    assert stated["inertia_nm_s2_per_rad"] == "N m s^2/rad"
    assert not [name for name, unit in stated.items() if unit.startswith("N/") or unit in ("m", "N", "m/s", "kg")]
    assert rig_of(transfer("V/V")).deflection == "voltage"


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        ("unit", "is not that of a response over an excitation"),
        ("drive", "no voltage at TCP:+X"),
        ("answer", "no angle or angular"),
    ],
)
def test_what_does_not_belong_together_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], spoil: str, says: str
) -> None:
    unit = {"unit": "1", "drive": "m/V", "answer": "rad/N"}[spoil]
    files = files_of(tmp_path, Rig(), unit, (20.0,))
    assert run(["diagnose", *files, "--out", str(tmp_path / "out")]) == BAD_INPUT
    line = capsys.readouterr().err
    assert says in line
    assert "calibrate" not in line
    assert line.count("\n") == 1


def test_one_voltage_cannot_drive_and_answer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = files_of(tmp_path, Rig(excitation="voltage", response="voltage"), "V/V", (20.0,))
    assert run(["diagnose", *files, "--out", str(tmp_path / "out")]) == BAD_INPUT
    assert "different nodes" in capsys.readouterr().err


def test_an_unknown_unit_names_the_remedy() -> None:
    with pytest.raises(InputError, match=r"is not that of a response over an excitation"):
        rig_of(transfer("furlong/N"))
