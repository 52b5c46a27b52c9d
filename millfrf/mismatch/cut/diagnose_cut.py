"""Diagnosis of a cut: the physics that a computed cutting force leaves out."""

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
from .comparison import CutComparison, accepted_causes, odd_coefficients, weighed_candidates
from .errors import cut_remainder, fit_halves, improvement, lowers
from .fitting import CutFit, fit_cut, fit_turned, started
from .force import Belief
from .hypothesis import CutHypothesis, MeasuredCut
from .library import cut_library
from .physics import CutPhysics
from .recordings import CutChatter, CutRecording, chatter_of
from .settings import CUT, CutSettings
from .spectra import force_spectra


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
"""A diagnosis of a cut: see :class:`millfrf.mismatch.Diagnosis`."""


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


NOISE_ROUNDS = 3
"""Fits with all causes after each of which the noise is taken from the residual anew."""


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
    """Compare measured with computed cutting forces, and name what the computed ones leave out.

    Coefficients are refitted within ``coefficient_error`` first. A cause is accepted if it lowers the score
    ``2 sum |W r|^2 + |u|^2 + n ln N`` by 20, stands out of its own error by four, and, fitted to either half of the
    blocks of time, lowers the misfit of the other halves by 10 together. All causes together must lower the error of
    the force there with p < 0.01. Where more is left than noise and usual error, the verdict is ``partly explained`` if
    the causes removed half of it. Otherwise it is ``unexplained``, and nothing is named. A recording that chatters is
    not explained by a force that repeats: the verdict is ``unexplained``, and ``details.chatter`` says why.

    Parameters
    ----------
    process
        Cutter, engagement and coefficients as the cutting file states them.
    depth
        Axial depth, m.
    recordings
        One or more cuts of this process, of at least 80 revolutions.
    settings
        Thresholds of a cut's diagnosis.
    coefficient_error
        One standard deviation of what a laboratory's coefficients are off, a share; None: as the settings say.
    force_error
        Share by which each spectral line of a right computed force is still off; None: as the settings say.
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
    tell = progress or _silent
    tell("spindle and noise")
    spectra = tuple(force_spectra(recording, process.teeth) for recording in recordings)
    cut = MeasuredCut(Belief(process, settings.coefficient_error), depth, spectra, settings.force_error)
    known = all(recording.motion is not None for recording in recordings)
    causes, closed = _weighable(process, settings.causes or cut_library(), known)
    start = started(cut, [(cause, cause.stated(process)) for cause in causes])
    chatter = tuple(chatter_of(recording, process) for recording in recordings)
    if any(one.unstable for one in chatter):
        closed = [Candidate(one.name, 0.0, "not weighed: a recording chatters") for one in causes] + closed
        causes = []
    names = tuple(cause.name for cause in causes)
    cut, start = _with_noise(cut, start, names)
    found = search(CutComparison(cut, names, settings), fit_turned(cut, start, ()), tell)
    tell("what is left")
    return _diagnosis(cut, start, found, closed, chatter, settings)


def _silent(stage: str) -> None:
    del stage


def _weighable(
    process: MillingProcess, causes: Mapping[str, CutPhysics], known: bool
) -> tuple[list[CutPhysics], list[Candidate]]:
    """Causes that can be weighed, and the others with the reason."""
    open_ones, closed = [], []
    for name, cause in causes.items():
        why = cause.obstacle(process) or ("" if known or not cause.moves else "no motion at the tip is known")
        if why:
            closed.append(Candidate(name, 0.0, f"not weighed: {why}"))
        else:
            open_ones.append(cause)
    return open_ones, closed


def _with_noise(cut: MeasuredCut, start: CutHypothesis, names: Sequence[str]) -> tuple[MeasuredCut, CutHypothesis]:
    """Noise as all causes together leave it, and the numbers as stated with the spindle as they show it."""
    rich = start
    for _ in range(NOISE_ROUNDS):
        cut = cut.with_noise_of(rich)
        rich = fit_turned(cut, rich, names).hypothesis
    return cut, replace(start, laws=rich.laws)


def _diagnosis(
    cut: MeasuredCut,
    start: CutHypothesis,
    found: Search[CutFit],
    closed: Sequence[Candidate],
    chatter: tuple[CutChatter, ...],
    settings: CutSettings,
) -> CutDiagnosis:
    """Held-out proof, what is left, verdict, and what is named."""
    base, final, proof = found.base, found.current, settings.proof
    nominal = fit_cut(cut, start, (), refit=False)
    as_stated = fit_halves(cut, nominal.hypothesis, (), refit=False)
    refitted = fit_halves(cut, base.hypothesis, ())
    improved = fit_halves(cut, final.hypothesis, final.freed) if final.freed else refitted
    named = bool(final.freed) and lowers(cut, refitted, improved, proof)
    kept = final if named else base
    odd = odd_coefficients(cut, kept, settings) if lowers(cut, as_stated, refitted, proof) else []
    before, after = (cut_remainder(cut, one.hypothesis, settings) for one in (base, kept))
    shaken = any(one.unstable for one in chatter)
    verdict = verdict_of(Findings(before.left, after.left, named or bool(odd), shaken), settings.verdict)
    told = verdict in ("explained", "partly explained")
    causes = accepted_causes(cut, found, improved) if told and named else []
    shown = kept if told else base
    details = CutDetails(cut, nominal, base, shown, chatter, settings)
    return CutDiagnosis(
        "cut",
        verdict,
        tuple([*causes, *odd] if told else ()),
        (*weighed_candidates(found, shown), *closed),
        tuple(name for name in found.equivalents if name not in shown.freed) if shown.freed else (),
        improvement(cut, as_stated, refitted, improved if shown is final else refitted, proof),
        before.left,
        after.left if told else before.left,
        {"spindle_orders": list(before.orders), "channels": list(before.channels)},
        details,
        doubts=_doubts(cut, chatter),
        content={"cut": details.content()},
    )


def _doubts(cut: MeasuredCut, chatter: Sequence[CutChatter]) -> tuple[str, ...]:
    """Sentences that a reader must see beside the verdict."""
    doubts = [f"{one.name} chatters: {one.reason}." for one in chatter if one.unstable]
    motions = [spectra.recording.motion for spectra in cut.spectra]
    if any(motion is not None and motion.origin == "model" for motion in motions):
        doubts.append("The tip's motion was computed by a model from the measured forces, not measured.")
    return tuple(doubts)
