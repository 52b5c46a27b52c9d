"""Templates: what a file tells is filled in, what it does not tell is named by the command that reads it."""

import tomllib
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from scipy.io import savemat

from acquisition import Recording
from millfrf.command_line import run
from millfrf.core import InputError
from millfrf.core.described_tables import described_tables
from millfrf.cutting import PUBLISHED, read_cutting_process
from millfrf.new.mapping_file import new_mapping
from millfrf.new.templates import Material, toml_files

SAMPLES = np.random.default_rng(3).standard_normal((400, 3))


def _mat(folder: Path) -> Path:
    """Forces in columns, accelerations in rows, the rate as a number, as MATLAB users save them."""
    path = folder / "rig.mat"
    savemat(path, {"data": {"F": SAMPLES, "acc": SAMPLES.T}, "Fs": 2048.0, "note": "first cut"})
    return path


def _csv(folder: Path) -> Path:
    path = folder / "rig.csv"
    rows = "\n".join(f"{k / 500:.3f},{a:.6f},{b:.6f}" for k, (a, b, _) in enumerate(SAMPLES))
    path.write_text(f"time,Fx,ax\ns,kN,g\n{rows}\n")
    return path


def test_a_table_with_units_is_converted_without_a_change(tmp_path: Path) -> None:
    source, mapping, out = _csv(tmp_path), tmp_path / "map.toml", tmp_path / "rec.h5"
    assert run(["new", "mapping", str(source), "--out", str(mapping)]) == 0
    assert run(["convert", str(source), str(out), "--map", str(mapping)]) == 0
    with Recording(out) as recording:
        stream = recording.stream()
        assert stream.sample_rate == 500.0
        assert [str(channel.degree_of_freedom) for channel in stream.channels] == ["TCP:+X", "HOUSING:+X"]
        np.testing.assert_allclose(stream.read(), SAMPLES[:, :2] * [1000.0, 9.80665], atol=1e-2)


def test_what_a_mat_file_does_not_tell_is_left_open_and_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, mapping, out = _mat(tmp_path), tmp_path / "map.toml", tmp_path / "rec.h5"
    assert run(["new", "mapping", str(source), "--out", str(mapping)]) == 0
    assert "6 places are open" in capsys.readouterr().out
    assert run(["convert", str(source), str(out), "--map", str(mapping)]) == 2
    assert "channels[1].unit is missing" in capsys.readouterr().err
    text = mapping.read_text()
    for unit in ("kN", "g"):
        text = _units_filled(text, unit)
    mapping.write_text(text)
    assert run(["convert", str(source), str(out), "--map", str(mapping)]) == 0
    with Recording(out) as recording:
        stream = recording.stream()
        assert stream.sample_rate == 2048.0
        np.testing.assert_allclose(stream.read(), np.hstack([SAMPLES * 1000.0, SAMPLES * 9.80665]), rtol=1e-9)


def _units_filled(text: str, unit: str) -> str:
    """The next three open units."""
    lines, left = text.splitlines(), 3
    for number, line in enumerate(lines):
        if line.startswith("# unit =") and left:
            lines[number], left = f'unit = "{unit}"', left - 1
    assert left == 0
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("text.mat", {"note": "nothing"}, "contains no array of samples; it contains arrays note"),
        ("many.mat", {"x": np.ones((300, 100))}, "array x has 100 columns"),
    ],
)
def test_files_without_samples_are_refused(tmp_path: Path, name: str, content: dict[str, object], said: str) -> None:
    savemat(tmp_path / name, content)
    with pytest.raises(InputError, match=said):
        new_mapping(tmp_path / name)


def test_a_filled_cut_is_read_and_an_unfilled_one_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cut = tmp_path / "cut.toml"
    assert run(["new", "cut", "--out", str(cut), "--teeth", "4", "--diameter", "0.012", "--plan"]) == 0
    capsys.readouterr()
    assert run(["plan", str(cut)]) == 2
    assert "cutting.ktc_pa is missing" in capsys.readouterr().err
    given = {"ktc_pa": "6e8", "krc": "0.3", "immersion": '"down"', "radial_depth_m": "0.003"}
    lines = cut.read_text().splitlines()
    for name, value in given.items():
        place = next(k for k, line in enumerate(lines) if line.startswith(f"# {name} ="))
        lines[place] = f"{name} = {value}"
    cut.write_text("\n".join(lines))
    process = read_cutting_process(cut)
    assert (process.teeth, process.diameter, process.ktc) == (4, 0.012, 6e8)
    assert "plan" in tomllib.loads(cut.read_text())


@pytest.mark.parametrize("name", sorted(PUBLISHED))
def test_a_cut_of_a_material_has_its_published_coefficients_and_their_source(name: str, tmp_path: Path) -> None:
    published, cut = PUBLISHED[name], tmp_path / "cut.toml"
    assert run(["new", "cut", "--material", name, "--teeth", "2", "--diameter", "0.012", "--out", str(cut)]) == 0
    text = cut.read_text(encoding="utf-8")
    said = " ".join(line.removeprefix("#").strip() for line in text.splitlines())
    assert published.source in said
    assert published.conditions in said
    cut.write_text(text.replace("# immersion =", 'immersion = "slot" #'), encoding="utf-8")
    process = read_cutting_process(cut)
    assert process.ktc == pytest.approx(1e6 * published.tangential)
    assert process.krc * process.ktc == pytest.approx(1e6 * published.radial, rel=1e-3)
    assert process.kac * process.ktc == pytest.approx(1e6 * (published.axial or 0.0), rel=2e-3)
    assert (process.kte, process.kre, process.kae) == pytest.approx(tuple(1e3 * edge for edge in published.edges))


def test_every_published_material_can_be_named() -> None:
    assert set(get_args(Material)) == set(PUBLISHED)


@pytest.mark.parametrize("driver", ["ni", "replay", "simulated"])
def test_a_session_has_every_key_of_its_driver_and_no_other(driver: str, tmp_path: Path) -> None:
    out = tmp_path / "session.toml"
    assert run(["new", "session", "--out", str(out), "--driver", driver]) == 0
    text = out.read_text()
    assert tomllib.loads(text)["device"] == {"driver": driver}
    session = next(file for file in toml_files() if file.name == "session")
    for table in described_tables(session):
        of_driver = table.heading == "[device]" and f"`{driver}`" in [key.kind for key in table.keys]
        for key in table.keys if of_driver else ():
            assert f"\n# {key.name} =" in text or f"\n{key.name} =" in text, key.name


def test_nothing_is_replaced_unasked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "cut.toml"
    out.write_text("mine")
    assert run(["new", "cut", "--out", str(out)]) == 2
    assert "replace it with --force" in capsys.readouterr().err
    assert out.read_text() == "mine"
    assert run(["new", "cut", "--out", str(out), "--force"]) == 0


def test_schemas_are_written_for_every_kind(tmp_path: Path) -> None:
    assert run(["new", "schemas", "--out", str(tmp_path / "schemas")]) == 0
    written = {path.name for path in (tmp_path / "schemas").iterdir()}
    assert written == {f"{file.name}.schema.json" for file in toml_files()}


def test_a_campaign_names_its_recordings_and_what_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "campaign.toml"
    _csv(tmp_path)
    words = ["new", "campaign", "*.h5", "--robot", "kuka_kr90_r3100", "--out", str(out)]
    assert run(words) == 0
    content = tomllib.loads(out.read_text())
    assert content["recordings"] == [{"files": ["*.h5"]}]
    assert content["campaign"] == {"robot": "kuka_kr90_r3100"}
    capsys.readouterr()
    assert run(["campaign", str(out), "--dry-run"]) == 2
    assert "fit.band_hz is missing" in capsys.readouterr().err
