"""Measured systems of other laboratories: from a linear model to the named cause, and what that does to test parts."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from estimation import windowed_spectrum
from millfrf.mismatch import (
    Hypothesis,
    LabError,
    ModelShape,
    Settings,
    diagnose,
    fit,
    improved_model_of,
    read_recordings,
)
from millfrf.mismatch.faults.clipping_repair import repair_faults
from millfrf.mismatch.records.bands import with_measured_noise
from millfrf.mismatch.records.reading import in_deflections
from millfrf.steps.fit import fit as fit_model
from modal_fit import read_modal_model

pytestmark = pytest.mark.shared_data


def example(name: str) -> ModuleType:
    """A script of the examples' folder as a module."""
    path = Path(__file__).resolve().parents[2] / "examples" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.mark.long
def test_silverbox_is_a_hardening_spring_and_its_arrowhead_is_simulated_freely(shared_data: Path) -> None:
    """A Duffing circuit (Wigren & Schoukens 2013): exponent three; the free run's error falls to less than a tenth."""
    silverbox = example("silverbox_diagnosis")
    signals, nominal, result = silverbox.study(shared_data / "silverbox")
    strongest = max(result.physics, key=lambda cause: cause.evidence)
    assert strongest.name == "stiffness_hardening"
    assert strongest.parameters["exponent"] == pytest.approx(3.0, abs=0.05)
    before = silverbox.free_run_errors(nominal, signals)
    after = silverbox.free_run_errors(silverbox.improved_model(result.details.final.hypothesis), signals)
    assert all(after[part] < 0.1 * before[part] for part in before)
    assert after["arrowhead"] < 1.0  # mV; a neural state-space encoder is given as about 6


@pytest.mark.long
def test_robot_drive_has_dry_friction_of_the_published_size(shared_data: Path) -> None:
    """EMPS: inverse dynamics of its authors give 20.39 N; the closed loop's force error falls to theirs."""
    drive = example("robot_drive_diagnosis")
    folder = shared_data / "emps-robot-drive"
    result, drives, predicted = drive.study(folder)
    assert [cause.name for cause in result.physics] == ["coulomb_friction"]
    assert result.verdict == "explained"
    assert result.physics[0].parameters["friction_n"] == pytest.approx(20.39, rel=0.1)
    assert predicted["named cause"] < 0.25 * predicted["rigid mass"]
    test = drive.read_record(folder / "DATA_EMPS_PULSES.mat")
    force = {name: drive.errors(each, test)["closed loop force, %"] for name, each in drives.items()}
    assert force["named cause"] < 0.33 * force["rigid mass"]
    assert force["named cause"] < 1.15 * force["published"]


@pytest.mark.long
def test_friction_of_a_frame_has_a_force_of_its_own_at_each_contact_load(shared_data: Path) -> None:
    """Plate of a frame on its moving base, with a contact loaded by four weights (Marino & Cicirello 2023).

    One dry friction for each recording, fitted by a simulation that sticks exactly, with common modes: 0.53, 0.83, 1.16
    and 1.49 N leave 7.4, 8.2, 8.8 and 3.0 % of the middle half. With nominal modes: 0.69, 1.00, 1.34 and 1.66 N.
    """
    folder = shared_data / "friction-frame"
    model = read_modal_model(folder / "nominal.json")
    forces = {250: (0.53, 0.69), 350: (0.83, 1.0), 450: (1.16, 1.34), 550: (1.49, 1.66)}
    diagnosis = diagnose(model, read_recordings([folder / f"w{load}.h5" for load in forces], model))
    (cause,) = diagnosis.physics
    assert cause.name == "coulomb_friction"
    for load, (low, high) in forces.items():
        force = cause.parameters[f"friction_n_in_w{load}"]
        assert low < force < high
        assert cause.standard_errors[f"friction_n_in_w{load}"] < 0.1 * force
    errors, textbook = [error.after for error in diagnosis.held_out], [0.074, 0.082, 0.088, 0.030]
    assert len(errors) == len(textbook)
    assert np.linalg.norm(errors) < 1.3 * np.linalg.norm(textbook)


def test_pulses_of_the_robot_drive_are_part_of_the_recorded_command(shared_data: Path) -> None:
    """Command minus the drive's own controller is zero in one record and the pulses in the other."""
    drive = example("robot_drive_diagnosis")
    for name, size in (("DATA_EMPS.mat", 0.0), ("DATA_EMPS_PULSES.mat", 1.0)):
        record = drive.read_record(shared_data / "emps-robot-drive" / name)
        speed = (record.position[2:] - record.position[:-2]) / (2 * drive.STEP)
        asked = record.derivative * (record.proportional * (record.reference - record.position)[2:] - speed)
        rest = record.force[2:] / record.drive - asked - record.pulses[2:]
        assert np.std(rest[20:]) < 0.01  # V; the command's standard deviation is 1.5 V
        assert np.std(record.pulses) == pytest.approx(size * 2.535, rel=0.01)


def test_linear_model_of_the_mirror_holds_at_its_own_amplitude_only(shared_data: Path) -> None:
    """Shares of power: thousandths at its own level, far above the noise; a tenth from the weakest to the strongest."""
    mirror = example("mirror_diagnosis")
    folder = shared_data / "fsm-cubespec-mimo"
    frf, noise, distortion = mirror.linear_frf(folder, 300)
    assert mirror.left_over(folder, frf, 300) < 0.003
    assert mirror.left_over(folder, frf, 100) > 0.1
    assert noise < 3e-5
    assert distortion > 30 * noise


def test_resonances_of_an_aircraft_that_shift_are_no_tones(shared_data: Path) -> None:
    """F-16: modes shift by half of their width between two levels, and leave lines as sharp as a tone's."""
    aircraft = example("aircraft_diagnosis")
    records = aircraft.read_records(shared_data / "f16-ground-vibration")
    model = aircraft.nominal_model(records.trained[0])
    decay = float((-model.poles.real).min())
    model, recordings = in_deflections(model), list(records.trained)
    lines = [with_measured_noise(windowed_spectrum(each, aircraft.BAND, decay)) for each in recordings]
    shape = ModelShape(model, LabError())
    base = fit(lines, Hypothesis(shape, np.zeros(shape.size)), iterations=30)
    repaired, _, faults = repair_faults(lines, base, Settings())
    assert faults == []
    assert all(len(each.frequencies) == len(other.frequencies) for each, other in zip(repaired, lines, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("band", [(4.0, 10.0), (2.0, 15.0)])
def test_slip_at_the_payload_of_an_aircraft_is_told_in_part(shared_data: Path, band: tuple[float, float]) -> None:
    """F-16 ground vibration: bolts that slip between wing and payload; the periods repeat to 1 %, so that what is left
    is no noise. A table's mass, a gain or a resonating force cell are no answer."""
    files = [shared_data / "f16-ground-vibration" / f"level_{level}.h5" for level in (1, 3)]
    model = fit_model(files[0], band=band).model
    diagnosis = diagnose(model, read_recordings(files, model))
    names = {cause.name for cause in diagnosis.physics}
    assert diagnosis.verdict in ("partly explained", "unexplained")
    assert names <= {"hysteresis", "stiffness_softening", "coulomb_friction", "missing_mode"}
    assert "PAYLOAD" in str([cause.location.get("places") for cause in diagnosis.physics]) or not names
    assert diagnosis.leftover > 0.5
    assert diagnosis.details.band is not None
    assert diagnosis.details.band.edges == band


@pytest.mark.slow
def test_a_joint_of_an_aircraft_predicts_both_levels(shared_data: Path) -> None:
    """Sliding elements between wing and payload leave less of either level than six modes fitted to both leave."""
    aircraft = example("aircraft_diagnosis")
    records, nominal, result = aircraft.study(shared_data / "f16-ground-vibration")
    assert result.verdict == "partly explained"
    assert [cause.name for cause in result.physics] == ["hysteresis"]
    assert result.physics[0].location["places"][0]["place"] == "between WING and PAYLOAD along Z"
    lower, upper = (aircraft.of_model(improved_model_of(result), each) for each in records.tests)
    assert lower < 0.75 * aircraft.of_model(nominal, records.tests[0])
    both = list(records.trained)
    assert upper < 0.6 * aircraft.least_squares_error(both, records.tests[1], nominal, 6)
    assert lower < 0.2 * aircraft.least_squares_error(both, records.tests[0], nominal, 6)
