"""Scores of opened truths: right, partial, equivalent, wrong, abstained, failed; direction, coverage, held-out."""

from dataclasses import dataclass
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import Recording
from millfrf.core import MillfrfError
from modal_fit import read_modal_model

from .diagnosis_reading import Answer
from .excitation import RATE
from .integrator import linear_response
from .structures import Structure
from .tip_scale import counted_at_tip

ALIASES = {
    "delay_s": ("delay", "delay_seconds", "tau", "tau_s"),
    "corner_hz": ("corner", "corner_frequency_hz", "cutoff_hz", "high_pass_hz"),
    "hz": ("frequency_hz", "frequency", "tone_hz"),
    "fn": ("frequency_hz", "natural_frequency_hz", "fn_hz", "frequency"),
    "zeta": ("damping", "damping_ratio"),
    "gain": ("factor", "sensitivity"),
    "limit": ("level", "clip_level", "clipping_limit"),
    "k3": ("cubic", "cubic_stiffness"),
    "fc": ("friction_force", "coulomb_force", "coulomb_force_n"),
    "half_gap": ("gap", "half_gap_m"),
    "stiffness_loss": ("loss", "stiffness_loss_n_per_m"),
    "stiffness_change": ("change", "stiffness_change_n_per_m"),
    "c_g": ("coupling", "gyroscopic_coefficient"),
    "rotation_angle_deg": ("angle_deg",),
}
"""Other spellings of the truths' parameters that are taken for the same."""

_RUN_IN = 8 * RATE


@dataclass(frozen=True)
class Score:
    """One scored case.

    Parameters
    ----------
    expected, answered
        As the confusion matrix has them; pairs are joined by ``+``.
    outcome
        ``right, partial, equivalent, wrong, abstained, failed``.
    strength
        Response change over noise that was reached.
    beyond
        What of it no linear structure could imitate, over noise.
    angle
        Between true and found joint direction, degrees, or None.
    covered
        Parameter names and whether the 95 % interval holds the truth.
    removed, claimed
        Share of held-out excess error removed: by our own prediction check, and by the tool's word.
    """

    name: str
    spec: dict[str, Any]
    expected: str
    answered: str
    outcome: str
    strength: float
    beyond: float
    angle: float | None
    covered: tuple[tuple[str, bool], ...]
    removed: float | None
    claimed: float | None
    seconds: float


def score_case(name: str, truth: dict[str, Any], answer: Answer, run: dict[str, Any]) -> Score:
    """Compare an answer with the opened truth; ``run``: seconds, and RMS errors on the unseen recording."""
    outcome = outcome_of(truth, answer)
    named = "+".join(sorted(answer.names)) or answer.verdict
    true_direction = truth["joint_direction_at_tcp"]
    angle = None
    if true_direction is not None and answer.direction is not None and outcome in ("right", "partial"):
        angle = angle_between(np.asarray(true_direction), answer.direction)
    return Score(
        name,
        truth["spec"],
        "+".join(sorted(truth["effects"])) or "none",
        named,
        outcome,
        truth["residual_over_noise"],
        truth["residual_after_refit_over_noise"],
        angle,
        tuple(_covered(truth, answer)) if outcome == "right" else (),
        excess_removed(run.get("held_out"), truth),
        answer.removed,
        float(run["seconds"]),
    )


def outcome_of(truth: dict[str, Any], answer: Answer) -> str:
    """One word; an extra ``modal_parameters`` is no fault where the nominal model is off by a lab's error or more."""
    if answer.verdict == "failed":
        return "failed"
    effects, named = set(truth["effects"]), set(answer.names)
    if effects and truth["spec"]["nominal_off"] >= 0.9 and "modal_parameters" not in effects:
        named -= {"modal_parameters"} if len(named) > 1 or answer.verdict in ("unlisted", "unexplained") else set()
    # a small mode that is really there may be named beside the effect
    named -= set(truth["accepted_also"]) - effects if len(named) > 1 and effects else set()
    if not effects:
        return _control(set(truth["accepted_also"]), named, answer.verdict)
    if effects == {"unexplained"}:
        return "wrong" if named else ("right" if answer.verdict in ("unlisted", "unexplained") else "abstained")
    if not named:
        return "abstained"
    if named == effects:
        return "right"
    if named < effects:
        return "partial"
    missing, extra = effects - named, named - effects
    stated = missing and missing <= set(answer.equivalents) and len(extra) <= len(missing)
    return "equivalent" if stated else "wrong"


def _control(accepted: set[str], named: set[str], verdict: str) -> str:
    if named:
        return "right" if named <= accepted else "wrong"
    return "right" if verdict == "none" else "wrong"


def angle_between(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Between two lines, degrees."""
    cosine = abs(one @ other) / np.linalg.norm(one) / np.linalg.norm(other)
    return float(np.degrees(np.arccos(min(cosine, 1.0))))


def _covered(truth: dict[str, Any], answer: Answer) -> list[tuple[str, bool]]:
    """One interval a true number: modes and tones both have frequencies, a tone harmonics; the nearest is meant."""
    result = []
    for true in counted_at_tip(truth["spec"], truth["parameters"]):
        for name, value in true.items():
            spellings = (name, *ALIASES.get(name, ()))
            if not isinstance(value, int | float):
                continue
            like = [
                (abs(estimate - value), error) for given, estimate, error in answer.parameters if given in spellings
            ]
            if like:
                off, error = min(like)
                result.append((name, off <= 1.96 * error))
    return result


def wilson(successes: int, trials: int, z: float = 1.96) -> tuple[float, float]:
    """95 % interval of a proportion (Wilson, JASA 22, 1927).

    >>> [round(x, 3) for x in wilson(95, 100)]
    [0.888, 0.978]
    """
    if not trials:
        return 0.0, 1.0
    share = successes / trials
    middle = (share + z * z / (2 * trials)) / (1 + z * z / trials)
    half = z / (1 + z * z / trials) * sqrt(share * (1 - share) / trials + z * z / (4 * trials**2))
    return max(0.0, middle - half), min(1.0, middle + half)


def held_out_errors(folder: Path, prediction: Path) -> dict[str, Any] | None:
    """RMS errors on the unseen recording after 8 s, per acceleration: of the nominal model, and of a prediction.

    The nominal model's response is our own. None where there is no readable prediction.
    """
    try:
        measured, forces, names = _signals(folder / "unseen.h5")
        predicted, _, predicted_names = _signals(prediction)
        improved = measured - predicted[:, [predicted_names.index(name) for name in names]]
    except (OSError, ValueError, KeyError, MillfrfError):
        return None
    model = read_modal_model(folder / "nominal.json")
    columns = ["xyz".index(name[1]) for name in names]
    tapered = forces * np.clip(np.arange(len(forces)) / RATE, 0, 1)[:, None]
    believed = Structure(model.poles, model.left, model.right[:, :3], model.left)
    nominal = measured - linear_response(believed, tapered)[:, columns]
    spans = {"nominal": nominal, "improved": improved}
    return {"columns": columns, **{key: error[_RUN_IN:-RATE].std(axis=0).tolist() for key, error in spans.items()}}


def excess_removed(errors: dict[str, Any] | None, truth: dict[str, Any]) -> float | None:
    """``1 - (improved - floor)/(nominal - floor)``, each the RMS over channels of errors in units of the floor.

    The floor is the noise on accelerations and what the noise on forces makes of them; None where the nominal model is
    within 20 % of it already.
    """
    if errors is None:
        return None
    floor = np.asarray(truth["recordings"]["unseen"]["noise_floor_rms"])[errors["columns"]]
    before, after = (float(np.sqrt(np.mean((np.array(errors[k]) / floor) ** 2))) for k in ("nominal", "improved"))
    return None if before < 1.2 else 1 - (after - 1) / (before - 1)


def _signals(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64], list[str]]:
    """Accelerations, forces and the accelerations' names of a recording."""
    with Recording(path) as recording:
        stream = recording.stream()
        names = [channel.name for channel in stream.channels_of("acceleration")]
        forces = [channel.name for channel in stream.channels_of("force")]
        return stream.read(channels=names), stream.read(channels=forces) if forces else np.zeros((0, 3)), names
