"""`CutDetails`: fits and recordings of a cutting diagnosis, what its file says, and the improved cutting file."""

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from cutting import MillingProcess, write_cutting_process

from ...inference import Diagnosis
from .fits import CutFit, MeasuredCut
from .recordings import CutChatter
from .settings import CutSettings


@dataclass(frozen=True)
class CutDetails:
    """What a diagnosis of a cut holds beside every diagnosis.

    Parameters
    ----------
    cut
        Recordings, cutter and noise.
    nominal, base, final
        Fits with the numbers of the cutting file, with coefficients refitted, and with the causes that are told.
    chatter
        Judgement of each recording on the stability of its cut.
    settings
        Thresholds that were used.
    """

    cut: MeasuredCut
    nominal: CutFit
    base: CutFit
    final: CutFit
    chatter: tuple[CutChatter, ...]
    settings: CutSettings

    def improved_process(self) -> MillingProcess:
        """The cutting file's process with refitted coefficients and the accepted causes that it has a place for."""
        process = self.cut.belief.process_at(self.final.hypothesis.deviations)
        for cause, values in self.final.hypothesis.acting:
            if cause.name in self.final.freed:
                process = cause.improved(process, values)
        return process

    def content(self) -> dict[str, Any]:
        """What a diagnosis file says of a cut alone: plain numbers and texts, units in their names."""
        return {
            "compared": "cutting force",
            "depth_m": self.cut.depth,
            "coefficient_error": self.cut.belief.error,
            "force_error": self.cut.force_error,
            "chatter": [
                {"name": one.name, "kind": one.kind, "frequency_hz": one.frequency, "reason": one.reason}
                for one in self.chatter
            ],
            "recordings": [
                {
                    "name": spectra.recording.name,
                    "channels": list(spectra.recording.channels),
                    "band_hz": [float(spectra.frequencies[0]), float(spectra.frequencies[-1])],
                    "spindle_speed_rpm": law.speed * 30 / np.pi,
                    "spindle_speed_change_rpm_per_s": law.change * 30 / np.pi,
                    "motion": spectra.recording.motion.origin if spectra.recording.motion is not None else "none",
                }
                for spectra, law in zip(self.cut.spectra, self.final.hypothesis.laws, strict=True)
            ],
        }


CutDiagnosis = Diagnosis[CutDetails]
"""A diagnosis of a cut: see :class:`mismatch.inference.Diagnosis`."""


def write_improved_cut(path: str | os.PathLike[str], diagnosis: CutDiagnosis) -> None:
    """Write the cutting file with refitted coefficients and the accepted causes.

    Parameters
    ----------
    path
        The file; an older one is replaced.
    diagnosis
        The diagnosis whose fit is written.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    details = diagnosis.details
    names = ", ".join(spectra.recording.name for spectra in details.cut.spectra)
    causes = ", ".join(cause.name for cause in diagnosis.physics) or "none"
    comments = [f"refitted to {names}; verdict {diagnosis.verdict}, causes: {causes}"]
    for cause in diagnosis.physics:
        if "angle_rad" in cause.parameters:
            angle = cause.parameters["angle_rad"]
            comments.append(f"runout points {angle:.4g} rad from tooth 0; a cutting file says 0")
    write_cutting_process(path, details.improved_process(), comments)
