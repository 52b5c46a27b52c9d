"""The options of `millfrf diagnose` as they are typed: the band that is compared, and a lab's own error."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.steps.diagnose import diagnose
from millfrf.typed_arguments import with_lists_apart

Ask = Callable[..., tuple[int, str, str]]


@pytest.fixture
def ask(rig_files: tuple[Path, list[Path]], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Ask:
    """Diagnoses the files of a one-mode rig with further words on the command line; code, output, errors."""

    def asked(*more: str) -> tuple[int, str, str]:
        model, recordings = rig_files
        code = run(["diagnose", str(model), *map(str, recordings), *more, "--out", str(tmp_path / "out")])
        said = capsys.readouterr()
        return code, said.out, said.err

    return asked


@pytest.mark.long
@pytest.mark.parametrize("typed", [("--band", "6,16"), ("--band", "6", "16"), ("--band=6,16",)])
def test_the_band_that_is_asked_for_is_compared(ask: Ask, typed: tuple[str, ...], tmp_path: Path) -> None:
    code, said, _ = ask(*typed)
    assert code == DONE
    assert "compared from 6 to 16 Hz: the band that was asked for" in said
    stored = json.loads((tmp_path / "out" / "diagnosis.json").read_text())["compared_band"]
    assert (stored["low"], stored["high"]) == (6.0, 16.0)
    assert "the band that was asked for" in (tmp_path / "out" / "report.html").read_text()


def test_without_a_band_that_of_the_model_is_compared(ask: Ask) -> None:
    code, said, _ = ask()
    assert code == DONE
    assert "compared from 4 to 22 Hz: the band in which the model holds" in said


def test_the_band_in_python(rig_files: tuple[Path, list[Path]]) -> None:
    model, recordings = rig_files
    diagnosis = diagnose(model, *recordings, band=(3.0, 24.0))
    lines = [each.frequencies for each in diagnosis.details.recordings]
    assert all(each[0] >= 3.0 and each[-1] <= 24.0 and each[-1] > 23.5 for each in lines)
    assert "beyond the 4 to 22 Hz in which the model holds" in diagnosis.details.band.sentence


@pytest.mark.parametrize(
    ("band", "remedy"),
    [
        ("16,6", "give LO HI in Hz"),
        ("6,90", "compared up to 53.76 Hz; lower the upper edge"),
        ("12,16", "give a band around one"),
        ("6,12,16", "give 2 numbers"),
    ],
)
def test_bands_that_cannot_be(ask: Ask, band: str, remedy: str) -> None:
    code, _, said = ask("--band", band)
    assert code == BAD_INPUT
    assert remedy in said
    assert said.count("\n") == 1


@pytest.mark.long
@pytest.mark.parametrize(
    "typed", [("0.02",), ("0.02,0.02,0.02",), ("0.02", "0.02", "0.02")], ids=["one", "commas", "spaces"]
)
def test_a_labs_error_as_the_help_says(ask: Ask, typed: tuple[str, ...]) -> None:
    assert ask("--lab-error", *typed)[0] == DONE


def test_one_error_of_a_lab_stands_for_all_three() -> None:
    assert with_lists_apart(["--lab-error", "0.02", "m.json"], diagnose) == ["--lab-error", *3 * ["0.02"], "m.json"]
    assert with_lists_apart(["--lab-error", "1", "12", "3"], diagnose) == ["--lab-error", "1", "12", "3"]
    assert with_lists_apart(["--lab-error"], diagnose) == ["--lab-error"]


@pytest.mark.parametrize("typed", ["1,12,3", "0.1,0.1", "2", "0", "nan", "much"])
def test_errors_of_a_lab_that_cannot_be(ask: Ask, typed: str) -> None:
    code, _, said = ask("--lab-error", typed)
    assert code == BAD_INPUT
    assert "--lab-error" in said
    assert "give" in said
    assert said.count("\n") == 1
