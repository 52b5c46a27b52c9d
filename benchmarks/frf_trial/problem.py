"""`Problem`: what an engine is given; `Answer`: what it gives back. Both are files, for engines run in processes."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

DERIVATIVES = {"receptance": 0, "mobility": 1, "accelerance": 2}
"""Power of ``i w`` between receptance and the quantity."""
UNITS = {"receptance": "m/N", "mobility": "m/s/N", "accelerance": "m/s^2/N"}


@dataclass(frozen=True)
class Problem:
    """An FRF matrix and the band in which modes are asked for.

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Frequencies of the lines, increasing in equal steps.
    values : (n_lines, n_responses, n_excitations), complex
        Measured FRF matrix in the unit of ``quantity``.
    quantity
        ``receptance``, ``mobility`` or ``accelerance``.
    band
        Lowest and highest frequency, Hz.
    responses, excitations
        Labels ``node:direction``.
    response_covariance : (n_lines, n_responses, n_responses) or None
        Covariance of the responses on each line.
    excitation_covariance : (n_lines, n_excitations, n_excitations) or None
        ``E[dH[p, q] conj(dH[u, v])] = response[p, u] excitation[q, v]``; both or neither.
    coherence : (n_lines, n_responses, n_excitations) or None
        Coherence of each FRF by itself, as one excitation at a time gives it.
    averages : (n_responses, n_excitations), int, or None
        Behind each FRF that has a coherence; 0 where that is not known.
    """

    frequencies: NDArray[np.float64]
    values: NDArray[np.complex128]
    quantity: str
    band: tuple[float, float]
    responses: tuple[str, ...]
    excitations: tuple[str, ...]
    response_covariance: NDArray[np.complex128] | None = None
    excitation_covariance: NDArray[np.complex128] | None = None
    coherence: NDArray[np.float64] | None = None
    averages: NDArray[np.int64] | None = None

    def inside(self) -> NDArray[np.bool_]:
        """Lines in the band, (n_lines,)."""
        return np.asarray((self.frequencies >= self.band[0]) & (self.frequencies <= self.band[1]))


@dataclass(frozen=True)
class FoundMode:
    """One mode of an answer; standard errors are None where the engine states none.

    Parameters
    ----------
    shape
        Real and imaginary parts of the vector over the responses, or None.
    """

    frequency_hz: float
    damping_ratio: float
    frequency_error: float | None = None
    damping_error: float | None = None
    shape: tuple[tuple[float, float], ...] | None = None


@dataclass(frozen=True)
class Answer:
    """What an engine found, or why it found nothing.

    Parameters
    ----------
    status
        ``ok``, or why there is no answer: ``failed`` (an exception, its line in ``said``), ``too slow``, ``killed``.
    said
        Warnings and messages, one sentence each.
    seconds : s
        Processor time of the engine's work, without imports and reading.
    peak_mb
        Highest resident memory of the process.
    base_mb
        Resident memory of the process before the work began: interpreter, imports and the FRFs.
    candidates
        All that a user could pick from the engine's chart by hand; empty where nobody picks.
    """

    modes: tuple[FoundMode, ...]
    status: str = "ok"
    said: tuple[str, ...] = ()
    seconds: float = 0.0
    peak_mb: float = 0.0
    base_mb: float = 0.0
    candidates: tuple[FoundMode, ...] = ()


def write_problem(problem: Problem, path: Path) -> None:
    """Write as ``.npz``."""
    arrays = {key: value for key, value in vars(problem).items() if value is not None}
    np.savez(path, **arrays)


def read_problem(path: Path) -> Problem:
    """Read what :func:`write_problem` wrote."""
    with np.load(path) as file:
        result = {name: file[name] for name in file.files}
    result["quantity"] = str(result["quantity"])
    result["band"] = (float(result["band"][0]), float(result["band"][1]))
    for name in ("responses", "excitations"):
        result[name] = tuple(str(label) for label in result[name])
    return Problem(**result)


def write_answer(answer: Answer, path: Path) -> None:
    """Write as JSON, complete or not at all."""
    waiting = path.with_suffix(".part")
    waiting.write_text(json.dumps(asdict(answer), indent=1) + "\n", encoding="utf-8")
    waiting.replace(path)


def read_answer(path: Path) -> Answer:
    """Read what :func:`write_answer` wrote."""
    content = json.loads(path.read_text(encoding="utf-8"))
    for name in ("modes", "candidates"):
        content[name] = tuple(FoundMode(**mode) for mode in content[name])
    content["said"] = tuple(content["said"])
    return Answer(**content)
