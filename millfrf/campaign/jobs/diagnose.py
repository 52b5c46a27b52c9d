"""The job `diagnose`: what a nominal model leaves out of the recordings that belong together."""

from pathlib import Path

from millfrf.mismatch import LabError, Settings

from ...gate import read_checked_cutting
from ...structure import diagnose_files
from .sound_recordings import sound_files
from .work import Work

DIAGNOSIS = "diagnosis.json"


def diagnose(work: Work, folder: Path) -> list[str]:
    """Diagnosis, improved model and report.

    Raises
    ------
    InputError
        Model and recordings cannot be compared, or no recording is left.
    """
    with_cut = bool(work.settings["cutting"])
    recordings, lines = sound_files(work, 2 if with_cut else 1)
    process, doubts = read_checked_cutting(work.files[1]) if with_cut else (None, [])
    settings = Settings(LabError(*work.settings["lab_error"]))
    band = work.settings["band_hz"]
    made = diagnose_files(
        work.files[0],
        recordings,
        folder,
        settings,
        stream=work.settings["stream"],
        band=None if band is None else (band[0], band[1]),
        process=process,
        dated=False,
    )
    return [*lines, *doubts, *made.diagnosis.doubts]
