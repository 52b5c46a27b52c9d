"""What predict and diagnose ask: a sound model, what its file says of its fit, and channels that are alive."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import pytest

from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core import write_json
from modal_fit import ModalModel, write_modal_model
from replay_data import default_structure


def nominal(path: Path, change: dict[str, object] | None = None, unstable: bool = False) -> Path:
    """The cell's structure as a file, with a provenance, and with an unstable pole where asked for."""
    whole = default_structure()
    rows = [k for k, name in enumerate(whole.responses) if name.startswith("HOUSING:")]
    columns = [k for k, name in enumerate(whole.excitations) if name.startswith("TCP:")]
    model: ModalModel = replace(
        whole,
        right=whole.right[:, rows],
        left=whole.left[:, columns],
        responses=tuple(whole.responses[k] for k in rows),
        excitations=tuple(whole.excitations[k] for k in columns),
        poles=-whole.poles.conj() if unstable else whole.poles,
    )
    write_modal_model(path, model)
    content = json.loads(path.read_text(encoding="utf-8"))
    content["provenance"] = change or {}
    write_json(path, content)
    return path


def dead(source: Path, target: Path, column: int) -> Path:
    shutil.copy(source, target)
    with h5py.File(target, "r+") as file:
        file.attrs["format_version"] = 1  # as another program writes it: without checksums
        next(iter(file["signals"].values()))["samples"][:, column] = 0.0
    return target


def command(verb: str, model: Path, recording: Path, folder: Path) -> list[str]:
    out = folder / ("p.h5" if verb == "predict" else "d")
    return [verb, str(model), str(recording), "--out", str(out)]


@pytest.mark.parametrize("verb", ["predict", "diagnose"])
@pytest.mark.parametrize(("column", "name"), [(1, "fy"), (4, "ay")])
def test_a_dead_channel_is_refused(
    sweeps: dict[str, Path], tmp_path: Path, verb: str, column: int, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    model = nominal(tmp_path / "nominal.json")
    recording = dead(sweeps["up"], tmp_path / "up.h5", column)
    assert run(command(verb, model, recording, tmp_path)) == BAD_INPUT
    said = capsys.readouterr().err
    assert f"up.h5: channel {name} is dead (every sample is 0)" in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("verb", ["predict", "diagnose"])
def test_an_unstable_model_is_refused(
    sweeps: dict[str, Path], tmp_path: Path, verb: str, capsys: pytest.CaptureFixture[str]
) -> None:
    model = nominal(tmp_path / "nominal.json", unstable=True)
    assert run(command(verb, model, sweeps["up"], tmp_path)) == BAD_INPUT
    assert "it is unstable by itself" in capsys.readouterr().err


def test_a_poor_fit_is_doubted_beside_the_prediction(
    sweeps: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = nominal(tmp_path / "nominal.json", {"step": "fit", "reduced_chi_square": 9.0})
    assert run(command("predict", model, sweeps["up"], tmp_path)) == DONE
    said = capsys.readouterr()
    assert "warning: nominal.json: the misfit is 9.0 times what the noise explains" in said.out + said.err


def test_a_sound_pair_is_not_doubted(
    sweeps: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(command("predict", nominal(tmp_path / "nominal.json"), sweeps["up"], tmp_path)) == DONE
    said = capsys.readouterr()
    assert "warning" not in said.out + said.err
