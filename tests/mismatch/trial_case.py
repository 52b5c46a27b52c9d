"""The diagnosis of one case of a blind trial, made anew from its seed."""

from pathlib import Path

from benchmarks.blind_trial.case_spec import draw_cases
from benchmarks.blind_trial.sealed_case import write_case
from millfrf.mismatch import Settings, StructureDiagnosis, diagnose, read_recordings
from modal_fit import read_modal_model


def diagnosed(
    folder: Path, group: str, cases: int, seed: int, index: int, settings: Settings | None = None
) -> StructureDiagnosis:
    """What is told of a case of a blind trial."""
    spec = next(each for each in draw_cases(cases, seed, only=group) if each.index == index)
    given = write_case(spec, folder)
    model = read_modal_model(given / "nominal.json")
    files = [given / f"{level}.h5" for level in ("low", "mid", "high")]
    return diagnose(model, read_recordings(files, model), settings)
