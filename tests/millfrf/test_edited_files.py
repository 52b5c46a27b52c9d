"""Files of results that were edited after they were written: refused in one line, or accepted and named everywhere."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

import millfrf
from estimation import read_frf, write_frf
from millfrf.command_line import BAD_INPUT, DONE, flags_of, run
from millfrf.core.content_hashes import EDITED, WITHOUT_HASH
from millfrf.core.csv_tables import read_csv
from millfrf.core.provenance import content_state, edits_of, read_provenance
from modal_fit import read_modal_model, write_modal_model
from replay_data import default_structure, table_one_model, tip_model

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
LOBES = "lobes FILE --cutting cut.toml --speeds 600 1200 2 --max-depth 0.005 --method zero-order --out lobes.csv"
FIT = "fit FILE --band 13 25 --out fitted.json"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder with a model, an FRF and a cut, in which the commands run."""
    monkeypatch.chdir(tmp_path)
    write_modal_model("model.json", table_one_model())
    write_frf("frf.h5", tip_model(default_structure()).frf(np.arange(1.0, 60.0, 0.125)))
    Path("cut.toml").write_text(CUT, encoding="utf-8")
    return tmp_path


def edit_model() -> None:
    content = json.loads(Path("model.json").read_text(encoding="utf-8"))
    content["poles_rad_per_s"][0][0] *= 1.5
    Path("model.json").write_text(json.dumps(content, indent=4), encoding="utf-8")


def edit_frf() -> None:
    with h5py.File("frf.h5", "r+") as file:
        file["values"][40, 0, 0] *= 1.01


def ran(words: str, file: str) -> int:
    return run(words.replace("FILE", file).split())


@pytest.mark.parametrize(("words", "file"), [(LOBES, "model.json"), (FIT, "frf.h5"), ("convert FILE a.uff", "frf.h5")])
def test_an_edited_file_is_refused_and_the_remedy_works(
    words: str, file: str, capsys: pytest.CaptureFixture[str]
) -> None:
    edit_model()
    edit_frf()
    assert ran(words, file) == BAD_INPUT
    said = capsys.readouterr().err
    assert said.startswith(f"millfrf: {file} was edited after it was written, or is damaged: ")
    assert said.count("\n") == 1
    assert "--edited" in said
    assert ran(words + " --edited", file) == DONE
    assert f"warning: {file}: {EDITED}" in capsys.readouterr().err


def test_every_output_of_an_edited_file_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    edit_model()
    assert ran(LOBES + " --edited --json", "model.json") == DONE
    assert f"model.json: {EDITED}" in json.loads(capsys.readouterr().out)["warnings"]
    assert f"model.json: {EDITED}" in read_csv("lobes.csv").warnings
    assert read_provenance("lobes.csv")["sources"][0]["content"] == EDITED
    assert edits_of("lobes.csv") == f"made from model.json, {EDITED}"
    assert run(["report", "lobes.csv", "--out", "r.html"]) == DONE  # the table itself is as it was written
    assert f"made from model.json, {EDITED}" in Path("r.html").read_text(encoding="utf-8")


def test_an_edit_stays_known_over_several_steps() -> None:
    edit_frf()
    assert ran(FIT + " --edited", "frf.h5") == DONE
    assert ran(LOBES, "fitted.json") == DONE
    assert edits_of("lobes.csv") == f"made from frf.h5, {EDITED}"
    assert any(text.endswith(f"made from frf.h5, {EDITED}") for text in read_csv("lobes.csv").warnings)


def test_to_look_at_an_edited_file_is_no_use_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    edit_model()
    assert run(["inspect", "model.json"]) == DONE
    said = capsys.readouterr().out
    assert f"warning: model.json: {EDITED}" in said
    assert "nothing looks wrong" not in said


def test_another_layout_of_the_same_content_is_no_edit() -> None:
    content = json.loads(Path("model.json").read_text(encoding="utf-8"))
    Path("model.json").write_text(json.dumps(dict(reversed(content.items()))), encoding="utf-8")
    assert len(read_modal_model("model.json").poles) == 2


def test_python_accepts_edited_files_within_a_block() -> None:
    edit_model()
    edit_frf()
    for read, file in ((read_modal_model, "model.json"), (read_frf, "frf.h5")):
        with pytest.raises(millfrf.FileFormatError, match=r"millfrf\.accepting_edited\(\)"):
            read(file)
        with millfrf.accepting_edited() as edited:
            read(file)
        assert edited == [file]


def test_files_without_a_hash_are_read_and_their_provenance_states_it() -> None:
    content = json.loads(Path("model.json").read_text(encoding="utf-8"))
    del content["content_sha256"]
    Path("model.json").write_text(json.dumps(content), encoding="utf-8")
    with h5py.File("frf.h5", "r+") as file:
        del file.attrs["content_sha256"]
    assert ran(LOBES, "model.json") == DONE
    assert read_provenance("lobes.csv")["sources"][0]["content"] == WITHOUT_HASH
    assert "content" not in read_provenance("lobes.csv")["sources"][1]  # the cut is the user's own file
    assert content_state("frf.h5") == WITHOUT_HASH
    assert read_frf("frf.h5").frequencies[0] == 1.0


def test_every_bit_of_an_frf_that_changes_a_number_is_noticed() -> None:
    whole = Path("frf.h5").read_bytes()
    good, generator, silent = read_frf("frf.h5"), np.random.default_rng(0), 0
    for _ in range(150):
        damaged = bytearray(whole)
        damaged[int(generator.integers(0, len(whole)))] ^= 1 << int(generator.integers(0, 8))
        Path("frf.h5").write_bytes(damaged)
        try:
            frf = read_frf("frf.h5")
        except millfrf.InputError:
            continue
        silent += not all(
            np.array_equal(getattr(frf, name), getattr(good, name)) for name in ("values", "frequencies", "valid")
        )
        assert (frf.responses, frf.excitations, frf.unit) == (good.responses, good.excitations, good.unit)
    assert silent == 0


def test_commands_that_read_results_have_the_remedy() -> None:
    for words in ("lobes", "fit", "diagnose", "predict", "report", "calibrate", "robot learn", "campaign"):
        assert "edited" in flags_of(words), words
    assert "edited" not in flags_of("demo")
