"""Fields of the page for a cut and for the channels of a file: what they state, and what they refuse."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import millfrf
from millfrf.app.cut_fields import CutFields
from millfrf.app.mapping_form import MappingForm, sensitivity_of
from millfrf.command_line import run
from millfrf.core import InputError
from millfrf.cutting import read_cutting_process

LOGGER = "Logger ABC; 2026-11-02\n\nTime [s];Hammer [V];Acc [mV]\n"


@pytest.fixture
def logged(tmp_path: Path) -> Path:
    """Two channels in volts, as a logger writes them: 10 N a step, and 1 m/s^2."""
    t = np.arange(2000) / 1000
    rows = (f"{a:.4f};{10 * 2.25e-3 * k:.6f};{10.2 * k:.4f}" for k, a in enumerate(t))
    path = tmp_path / "tap.csv"
    path.write_text(LOGGER + "\n".join(rows) + "\n")
    return path


def test_channels_in_volts_are_read_with_their_sensitivity(logged: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    form = MappingForm(logged)
    mapping = logged.with_name("map.toml")
    assert [fields["quantity"].value for fields in form.fields] == ["force", "acceleration"]
    with pytest.raises(InputError, match="Hammer: give its unit"):
        form.write(mapping)
    form.fields[0]["sensitivity"].value = "2.25 mV/N"
    form.fields[1]["sensitivity"].value = "10.2"  # of mV or of V?
    for fields in form.fields:
        fields["node"].value, fields["direction"].value = "TCP", "+X"
    with pytest.raises(InputError, match="name the unit"):
        form.write(mapping)
    form.fields[1]["sensitivity"].value, form.fields[1]["unit"].value = "10.2 mV/(m/s^2)", "g"
    with pytest.raises(InputError, match="but unit g"):
        form.write(mapping)
    form.fields[1]["unit"].value = ""
    form.write(mapping)
    form.write(mapping)  # it replaces its own file
    monkeypatch.chdir(logged.parent)
    assert run(["convert", "tap.csv", "tap.h5", "--map", "map.toml"]) == 0
    with millfrf.open("tap.h5") as recording:
        samples = np.concatenate(list(recording.stream().blocks()))
        assert [channel.degree_of_freedom for channel in recording.stream().channels] == ["TCP:+X", "TCP:+X"]
    assert samples[3] == pytest.approx([30.0, 3.0], rel=1e-3)
    form.used[0].value = form.used[1].value = False
    with pytest.raises(InputError, match="no channel is chosen"):
        form.write(mapping)


@pytest.mark.parametrize("text", ["", "V/N", "0", "2.25 mW/N", "1e V/N"])
def test_what_is_no_sensitivity_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="as its data sheet does"):
        sensitivity_of(text, "V")


def test_a_sensitivity_in_volts_of_numbers_without_unit_is_refused() -> None:
    with pytest.raises(InputError, match=r"no unit.*0\.00225 if they are volts"):
        sensitivity_of("2.25 mV/N", "")


def test_a_date_of_toml_is_accepted(logged: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(logged.parent)
    channel = 'name = "a"\ncolumn = "Acc [mV]"\nquantity = "acceleration"\nunit = "m/s^2"\nsensitivity = 10.0\n'
    Path("map.toml").write_text(f'recorded_at = 2026-11-02\ntime = "Time [s]"\n[[channels]]\n{channel}')
    assert run(["convert", "tap.csv", "tap.h5", "--map", "map.toml"]) == 0
    with millfrf.open("tap.h5") as recording:
        assert recording.recorded_at.startswith("2026-11-02")


def test_sliders_state_a_cutting_file(tmp_path: Path) -> None:
    fields = CutFields()
    fields.sliders["teeth"].value = 3
    fields.write(tmp_path / "down.toml")
    process = read_cutting_process(tmp_path / "down.toml")
    assert (process.teeth, process.diameter, process.ktc) == (3, 0.012, 7e8)
    assert np.degrees([process.start_angle, process.exit_angle]) == pytest.approx([90, 180])
    fields.engagement.value = "slot"
    assert not fields.sliders["radial_depth_m"].visible
    assert np.degrees(fields.process.start_angle) == pytest.approx(0)
    fields.engagement.value = "up"
    fields.sliders["radial_depth_m"].value = 20.0
    with pytest.raises(InputError, match="radial"):
        _ = fields.process


def test_other_keys_of_a_cutting_file_stay(tmp_path: Path) -> None:
    path = tmp_path / "cut.toml"
    path.write_text(
        "[cutting]\nteeth = 4\ndiameter_m = 0.1527\nktc_pa = 6e8\nkrc = 0.2\n"
        "start_angle_deg = 30.5\nexit_angle_deg = 120\n"
        'runout_m = 1e-5\n[cutter]\nshape = "ball"\n'
    )
    fields = CutFields()
    fields.sliders["kac"].value = 0.4  # the file states none
    fields.read(path)
    assert fields.process == replace(read_cutting_process(path), feed_per_tooth=1e-4)
    assert fields.sliders["diameter_m"].value == 152.7
    fields.sliders["exit_angle_deg"].value = 130
    fields.write(tmp_path / "changed.toml")
    process = read_cutting_process(tmp_path / "changed.toml")
    assert process.runout == 1e-5
    assert np.degrees([process.start_angle, process.exit_angle]) == pytest.approx([30.5, 130])
    assert not process.is_cylinder
    fields.reset()
    assert fields.process.is_cylinder
    assert fields.process.runout == 0
    (tmp_path / "turn.toml").write_text("[turning]\n")
    with pytest.raises(InputError, match="describes no milling"):
        fields.read(tmp_path / "turn.toml")
