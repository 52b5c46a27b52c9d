"""Which physics a computed cutting force leaves out: `diagnose_cut`."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cutting import MillingProcess
from foundation import InputError

from ...inference.diagnosis import AcceptedCause, Candidate
from ..structure.acceptance import CLEAR, LEAST_EVIDENCE
from .cut_errors import form_errors
from .cut_fit import CutFit, fit_cut
from .cut_held_out import Halves, fit_halves, improvement, lowers
from .cut_leftover import CutLeftover, leftover
from .cut_results import COEFFICIENTS, CutDiagnosis
from .cut_search import Round, cause_of, covariance_of, search
from .cut_setting import Attempt, CutSetting
from .cut_start import fit_turned, started
from .force.force_coefficients import Belief
from .force.force_lines import force_lines
from .force.force_noise import noise_of
from .physics import CutPhysics, library
from .recordings.cut_chatter import CutChatter, chatter_of
from .recordings.cut_recording import CutRecording

AS_GOOD = 6.0
"""Evidence by which another cause may be worse and still not be told from the best: a likelihood ratio of 20."""

UNCONFIRMED = "fitted, but not confirmed: within its own error, or no gain on blocks held out"
"""Stage of a cause with evidence that was not accepted."""

ODD = 3.0
"""Laboratory's errors by which a coefficient must be off to be named."""

NOISE_LIKE = 0.08
"""Share of a residual force that may stand out of noise and usual error by chance, or beside an explanation."""

PARTLY = 0.5
"""Share of what stood out that causes must take away to be told at all."""

FORCE_ERROR = 0.01
"""Share by which each spectral line of a right computed force is still off."""


def diagnose_cut(
    process: MillingProcess,
    depth: float,
    recordings: Sequence[CutRecording],
    *,
    coefficient_error: float = 0.15,
    force_error: float = FORCE_ERROR,
) -> CutDiagnosis:
    """Compare measured with computed cutting forces, and name what the computed ones leave out.

    Coefficients are refitted within ``coefficient_error`` first. A cause is accepted if it lowers the score
    ``2 sum |W r|^2 + |u|^2 + n ln N`` by 20, stands out of its own error by four, and, fitted to either half of the
    blocks of time, lowers the misfit of the other halves by 10 together; all together must lower the error of the
    force there with p < 0.01. Where more is left than noise and usual error the verdict is ``partly explained`` if
    causes took away half of it, else ``unexplained``, and then nothing is named. A recording that chatters is not
    explained by a force that repeats: the verdict is ``unexplained``, and ``chatter`` says why.

    Parameters
    ----------
    process
        Cutter, engagement and coefficients as the cutting file states them.
    depth
        Axial depth, m.
    recordings
        One or more cuts of this process, of at least 80 revolutions.
    coefficient_error
        One standard deviation of what a laboratory's coefficients are off, a share.
    force_error
        Share by which each line of a right force model is still off: what is smaller is not named.

    Raises
    ------
    InputError
        No recording, or a depth or an error that is not positive.
    """
    if not recordings:
        raise InputError("no recording given; name one or more")
    if not (math.isfinite(depth) and depth > 0):
        raise InputError(f"depth = {depth!r} m must be positive; give --depth M in metres, for example 0.001")
    if not 0 <= force_error < 1:
        raise InputError(f"force error {force_error!r} must be a share from 0 to 1, for example 0.005")
    lines = tuple(force_lines(recording, process.teeth) for recording in recordings)
    setting = CutSetting(Belief(process, coefficient_error), depth, lines, force_error)
    known = all(recording.motion is not None for recording in recordings)
    causes, closed = _weighable(process, known)
    start = started(setting, [(cause, cause.stated(process)) for cause in causes])
    chatter = tuple(chatter_of(recording, process) for recording in recordings)
    shaken = any(one.unstable for one in chatter)
    setting, start = _with_noise(setting, start, [] if shaken else [cause.name for cause in causes])
    base = fit_turned(setting, start, ())
    if shaken:
        stages = [Candidate(cause.name, 0.0, "not weighed: a recording chatters") for cause in causes]
        return _result(setting, start, base, base, [], stages + closed, chatter)
    final, rounds = search(setting, base, [cause.name for cause in causes])
    return _result(setting, start, base, final, rounds, closed, chatter)


def _weighable(process: MillingProcess, known: bool) -> tuple[list[CutPhysics], list[Candidate]]:
    """Causes that can be weighed, and the others with the reason."""
    causes, closed = [], []
    for name, cause in library().items():
        why = cause.obstacle(process) or ("" if known or not cause.moves else "no motion at the tip is known")
        if why:
            closed.append(Candidate(name, 0.0, f"not weighed: {why}"))
        else:
            causes.append(cause)
    return causes, closed


def _with_noise(setting: CutSetting, start: Attempt, names: Sequence[str]) -> tuple[CutSetting, Attempt]:
    """Noise as all causes together leave it, and the numbers as stated with the spindle as they show it."""
    attempt = start
    for _ in range(3):
        noise = tuple(
            noise_of(lines, lines.measured - setting.shown(k, attempt), setting.shown(k, attempt), setting.force_error)
            for k, lines in enumerate(setting.lines)
        )
        noisy = replace(setting, noise=noise)
        attempt = fit_turned(noisy, attempt, names).attempt
    return noisy, replace(attempt, deviations=np.zeros(6), acting=start.acting)


def _result(
    setting: CutSetting,
    start: Attempt,
    base: CutFit,
    final: CutFit,
    rounds: list[list[Round]],
    closed: list[Candidate],
    chatter: tuple[CutChatter, ...],
) -> CutDiagnosis:
    nominal = fit_cut(setting, start, (), refit=False)
    halves = [fit_halves(setting, nominal.attempt, (), refit=False), fit_halves(setting, base.attempt, ())]
    halves.append(halves[1] if final is base else fit_halves(setting, final.attempt, final.freed))
    named = bool(final.freed) and lowers(setting, halves[1], halves[2])
    kept = final if named else base
    before, after = (leftover(setting, one.attempt) for one in (base, kept))
    odd = _coefficients(setting, kept) if lowers(setting, halves[0], halves[1]) else []
    verdict = _verdict(named or bool(odd), chatter, before, after)
    told = verdict in ("explained", "partly explained")
    physics = [*(_accepted(setting, final, rounds, halves[2]) if named else []), *odd] if told else []
    shown, left = (kept, after) if told else (base, before)
    better = improvement(setting, halves[0], halves[1], halves[2] if shown is final else halves[1])
    return CutDiagnosis(
        verdict, tuple(physics), tuple(_weighed(shown, rounds) + closed),
        _equivalents(final, rounds) if shown is final else (), better,
        left.share, _located(before), setting, nominal, base, shown, chatter,
    )  # fmt: skip


def _verdict(named: bool, chatter: Sequence[CutChatter], before: CutLeftover, after: CutLeftover) -> str:
    """See :class:`CutDiagnosis`."""
    if any(one.unstable for one in chatter):
        return "unexplained"
    if not named:
        return "none" if before.share <= NOISE_LIKE else "unexplained"
    if after.share <= NOISE_LIKE:
        return "explained"
    return "partly explained" if after.power <= (1 - PARTLY) * before.power else "unexplained"


def _weighed(final: CutFit, rounds: list[list[Round]]) -> list[Candidate]:
    """Every fitted cause as it was last weighed, beside those accepted before it; best first."""
    last = {one.name: one.evidence for ranked in rounds for one in ranked}
    found = []
    for name in sorted(last, key=lambda name: -last[name]):
        strange = last[name] > LEAST_EVIDENCE and name not in final.freed
        found.append(Candidate(name, last[name], UNCONFIRMED if strange else "fitted"))
    return found


def _accepted(setting: CutSetting, final: CutFit, rounds: list[list[Round]], halves: Halves) -> list[AcceptedCause]:
    last = {one.name: one.evidence for ranked in rounds for one in ranked}
    moving = any(cause_of(final.attempt, name).moves for name in final.freed)
    # what noise of the motion does a second time it has done a first time: the error that no residual shows
    again = fit_cut(setting.noisier(), final.attempt, final.freed) if moving else final
    form = form_errors(setting, final, halves, rounds[-1])
    found = []
    for name in final.freed:
        values = final.attempt.values(name)
        shifted = np.diag((again.attempt.values(name) - values) ** 2 + form[name].together)
        covariance = covariance_of(setting, final, name) + shifted
        told = cause_of(final.attempt, name).told(values, covariance, setting.belief.process)
        found.append(AcceptedCause(name, {}, *told, last[name]))
    return found


def _coefficients(setting: CutSetting, final: CutFit) -> list[AcceptedCause]:
    """Coefficients that are off by several times a laboratory's error."""
    off = final.attempt.deviations
    errors = np.sqrt(np.diag(final.covariance)[:6])
    odd = (np.abs(off) > ODD) & (np.abs(off) > CLEAR * errors)
    if not odd.any():
        return []
    values, spread = setting.belief.told(off, errors)
    fixed = fit_cut(setting, replace(final.attempt, deviations=np.zeros(6)), final.freed, refit=False)
    location = {"coefficients": [name for name, one in zip(values, odd, strict=True) if one]}
    return [AcceptedCause(COEFFICIENTS, location, values, spread, fixed.score - final.score)]


def _equivalents(final: CutFit, rounds: list[list[Round]]) -> tuple[str, ...]:
    if not final.freed:
        return ()
    best = max(one.evidence for one in rounds[0])
    return tuple(one.name for one in rounds[0] if one.name not in final.freed and one.evidence > best - AS_GOOD)


def _located(before: CutLeftover) -> dict[str, object]:
    return {"spindle_orders": list(before.orders), "channels": list(before.channels)}
