"""Rank and condition of the inputs: what `estimate` refuses, `fit` refuses too, in the same words."""

from pathlib import Path

import pytest

from millfrf.command_line import BAD_INPUT, DONE, run

BAND = ["--band", "13", "25"]


@pytest.mark.parametrize("names", [("up",), ("up", "down")])
def test_fewer_immersions_than_forces_are_not_fitted(
    sweeps: dict[str, Path], names: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [str(sweeps[name]) for name in names]
    code = run(["fit", *files, *BAND, "--out", str(tmp_path / "m.json")])
    said = capsys.readouterr().err
    assert code == BAD_INPUT, said
    assert "3 inputs are dependent" in said
    assert "3 tests with different immersions" in said
    assert not (tmp_path / "m.json").exists()


def test_fit_and_estimate_refuse_in_the_same_words(
    sweeps: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = []
    for verb, out in (("estimate", "f.h5"), ("fit", "m.json")):
        assert run([verb, str(sweeps["up"]), "--band", "16", "22", "--out", str(tmp_path / out)]) == BAD_INPUT
        said.append(capsys.readouterr().err)
    assert all("the 3 inputs are dependent on" in text for text in said)


def test_three_immersions_are_fitted_without_a_doubt(
    sweeps: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [str(path) for path in sweeps.values()]
    assert run(["fit", *files, *BAND, "--out", str(tmp_path / "m.json")]) == DONE
    assert "warning" not in capsys.readouterr().err
