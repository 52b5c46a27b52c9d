"""Diagnosis of a cut: search for the physics that a computed cutting force lacks."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from millfrf.core import InputError
from millfrf.core.compilation import DIAGNOSIS, compile_kernels
from millfrf.cutting import MillingProcess, write_cutting_process

from ..inference.diagnosis import Candidate, Diagnosis, Findings, verdict_of
from ..inference.search import Progress, Search, search
from .comparison import (
    CutComparison,
    accepted_causes,
    cut_remainder,
    fit_halves,
    implausible_coefficients,
    improvement,
    last_candidates,
    lowers,
)
from .fitting import CutFit, fit_cut, fit_with_tooth_numbers, started
from .hypothesis import Belief, CutHypothesis, MeasuredCut
from .physics import CutPhysics, cut_library
from .recordings import CutChatter, CutRecording, chatter_of, force_spectra
from .settings import CUT, CutSettings


@dataclass(frozen=True)
class CutDetails:
    """Fits and recordings of the diagnosis of a cut."""

    cut: MeasuredCut
    # fits with the numbers of the cutting file, with refitted coefficients, and with the reported causes
    nominal: CutFit
    base: CutFit
    final: CutFit
    chatter: tuple[CutChatter, ...]  # judgement of each recording on the stability of its cut
    settings: CutSettings  # thresholds that were used

    def improved_process(self) -> MillingProcess:
        """Return the process of the cutting file with refitted coefficients and accepted causes."""
        process = self.cut.belief.process_at(self.final.hypothesis.deviations)
        for cause, values in self.final.hypothesis.acting:
            if cause.name in self.final.freed:
                process = cause.improved(process, values)
        return process

    def content(self) -> dict[str, Any]:
        """Return the entry of a diagnosis file on the cut, with units in the names."""
        return {
            "compared": "cutting force",
            "depth_m": self.cut.depth,
            "coefficient_error": self.cut.belief.error,
            "force_error": self.cut.force_error,
            "chatter": [
                {
                    "name": judgement.name,
                    "kind": judgement.kind,
                    "frequency_hz": judgement.frequency,
                    "reason": judgement.reason,
                }
                for judgement in self.chatter
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


CutDiagnosis = Diagnosis[CutDetails]  # diagnosis of a cut, see :class:`millfrf.mismatch.Diagnosis`


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


NOISE_ROUNDS = 3  # fits with all causes, each followed by a new estimate of the noise


def diagnose_cut(
    process: MillingProcess,
    depth: float,
    recordings: Sequence[CutRecording],
    *,
    settings: CutSettings = CUT,
    coefficient_error: float | None = None,
    force_error: float | None = None,
    progress: Progress | None = None,
) -> CutDiagnosis:
    """Compare measured with computed cutting forces, and find the causes that the computed forces lack.

    Coefficients are first refitted within ``coefficient_error``. A cause is accepted if it lowers the score ``2 sum |W
    r|^2 + |u|^2 + n ln N`` by 20, if a number differs by four standard errors, and if it lowers the held-out misfit by
    10. For the held-out misfit, each half of the blocks of time is predicted by a fit to the other half. All causes
    together must lower the held-out error of the force with p < 0.01. If the final residual exceeds noise and usual
    error, the verdict is ``partly explained`` if the causes removed half of the residual, otherwise ``unexplained``
    without causes. A periodic force does not explain a recording with chatter: the verdict is then ``unexplained``, and
    ``details.chatter`` states the reason.

    Parameters
    ----------
    process
        Cutter, engagement and coefficients of the cutting file.
    depth
        Axial depth, m.
    recordings
        One or more cuts of this process, of at least 80 revolutions.
    settings
        Thresholds of a cut's diagnosis.
    coefficient_error
        Standard deviation of the errors of laboratory coefficients, a share; None: the value of the settings.
    force_error
        Relative error of each spectral line of a correct computed force; None: the value of the settings.
    progress
        Called with a short text when a new stage begins.

    Raises
    ------
    InputError
        There is no recording, or a depth or an error is not positive.
    """
    if not recordings:
        raise InputError("no recording given; name one or more")
    if not (math.isfinite(depth) and depth > 0):
        raise InputError(f"depth = {depth!r} m must be positive; give the depth in metres (--depth), for example 0.001")
    if coefficient_error is not None:
        settings = replace(settings, coefficient_error=coefficient_error)
    if force_error is None:
        force_error = settings.force_error
    if not 0 <= force_error < 1:
        raise InputError(f"force error {force_error!r} must be a share from 0 to 1, for example 0.005")
    settings = replace(settings, force_error=force_error)
    compile_kernels(*DIAGNOSIS)
    report = progress or _silent
    report("spindle and noise")
    spectra = tuple(force_spectra(recording, process.teeth) for recording in recordings)
    cut = MeasuredCut(Belief(process, settings.coefficient_error), depth, spectra, settings.force_error)
    motion_known = all(recording.motion is not None for recording in recordings)
    causes, excluded = _comparable(process, settings.causes or cut_library(), motion_known)
    start = started(cut, [(cause, cause.stated(process)) for cause in causes])
    chatter = tuple(chatter_of(recording, process) for recording in recordings)
    if any(judgement.unstable for judgement in chatter):
        excluded = [Candidate(cause.name, 0.0, "not weighed: a recording chatters") for cause in causes] + excluded
        causes = []
    names = tuple(cause.name for cause in causes)
    cut, start = _with_noise(cut, start, names)
    search_result = search(CutComparison(cut, names, settings), fit_with_tooth_numbers(cut, start, ()), report)
    report("residual")
    return _diagnosis(cut, start, search_result, excluded, chatter, settings)


def _silent(stage: str) -> None:
    del stage


def _comparable(
    process: MillingProcess, causes: Mapping[str, CutPhysics], known: bool
) -> tuple[list[CutPhysics], list[Candidate]]:
    """Return the causes that can be compared, and a candidate with the reason for each cause that cannot."""
    comparable, excluded = [], []
    for name, cause in causes.items():
        reason = cause.obstacle(process) or ("" if known or not cause.moves else "no motion at the tip is known")
        if reason:
            excluded.append(Candidate(name, 0.0, f"not weighed: {reason}"))
        else:
            comparable.append(cause)
    return comparable, excluded


def _with_noise(cut: MeasuredCut, start: CutHypothesis, names: Sequence[str]) -> tuple[MeasuredCut, CutHypothesis]:
    """Estimate the noise from the residual of fits with all causes.

    Returned are the cut with this noise, and the starting hypothesis with the spindle laws of the last fit.
    """
    all_causes = start
    for _ in range(NOISE_ROUNDS):
        cut = cut.with_noise_of(all_causes)
        all_causes = fit_with_tooth_numbers(cut, all_causes, names).hypothesis
    return cut, replace(start, laws=all_causes.laws)


def _diagnosis(
    cut: MeasuredCut,
    start: CutHypothesis,
    search_result: Search[CutFit],
    closed: Sequence[Candidate],
    chatter: tuple[CutChatter, ...],
    settings: CutSettings,
) -> CutDiagnosis:
    """Return the diagnosis: held-out test, residual, verdict and reported causes."""
    base, final, proof = search_result.base, search_result.current, settings.proof
    nominal = fit_cut(cut, start, (), refit=False)
    stated = fit_halves(cut, nominal.hypothesis, (), refit=False)
    refitted = fit_halves(cut, base.hypothesis, ())
    improved = fit_halves(cut, final.hypothesis, final.freed) if final.freed else refitted
    confirmed = bool(final.freed) and lowers(cut, refitted, improved, proof)
    accepted = final if confirmed else base
    coefficients = implausible_coefficients(cut, accepted, settings) if lowers(cut, stated, refitted, proof) else []
    before, after = (cut_remainder(cut, cut_fit.hypothesis, settings) for cut_fit in (base, accepted))
    chattering = any(judgement.unstable for judgement in chatter)
    verdict = verdict_of(
        Findings(before.left, after.left, confirmed or bool(coefficients), chattering), settings.verdict
    )
    reported = verdict in ("explained", "partly explained")
    causes = accepted_causes(cut, search_result, improved) if reported and confirmed else []
    final_fit = accepted if reported else base
    details = CutDetails(cut, nominal, base, final_fit, chatter, settings)
    return CutDiagnosis(
        "cut",
        verdict,
        tuple([*causes, *coefficients] if reported else ()),
        (*last_candidates(search_result, final_fit), *closed),
        tuple(name for name in search_result.equivalents if name not in final_fit.freed) if final_fit.freed else (),
        improvement(cut, stated, refitted, improved if final_fit is final else refitted, proof),
        before.left,
        after.left if reported else before.left,
        {"spindle_orders": list(before.orders), "channels": list(before.channels)},
        details,
        doubts=_doubts(cut, chatter),
        content={"cut": details.content()},
    )


def _doubts(cut: MeasuredCut, chatter: Sequence[CutChatter]) -> tuple[str, ...]:
    """Return warnings that a reader must see together with the verdict."""
    doubts = [f"{judgement.name} chatters: {judgement.reason}." for judgement in chatter if judgement.unstable]
    motions = [spectra.recording.motion for spectra in cut.spectra]
    if any(motion is not None and motion.origin == "model" for motion in motions):
        doubts.append("The tip's motion was computed by a model from the measured forces, not measured.")
    return tuple(doubts)
