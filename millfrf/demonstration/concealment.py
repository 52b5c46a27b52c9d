"""The blind demonstration: one effect is hidden and sealed, the diagnosis looks for it, then the seal is opened."""

import json
import math
import secrets
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import record
from millfrf.core import InputError, MillfrfError, writing_whole_file
from modal_fit import ModalModel
from replay_data import (
    FINE_RATE,
    LEVELS,
    ConcealedCell,
    ConcealedEffect,
    HammerCell,
    draw_effect,
    draw_name,
    dynamometer,
    joint_scale,
    milling_force,
    posture_robot,
    tip_accelerometers,
    tip_motion,
)

from ..chain import EstimateOptions, FitOptions, estimate_recordings, fit_model, write_estimate, write_fit
from ..progress import Progress, silent
from ..provenance import made
from .seal import open_seal, seal

SECONDS = 48.0
TAP_RATE = 2048.0
TAPS = EstimateOptions(segment=4.0, overlap=0.0, window="boxcar", band=(1.0, 200.0))
TAP_FIT = FitOptions((6.0, 45.0))


@dataclass(frozen=True)
class ConcealOptions:
    """Options of a concealed simulation, and where its files go.

    Parameters
    ----------
    out
        Folder for the files; it is made where it is not there.
    noise
        Noise of every acceleration, as a share of its signal; the forces have half of it.
    seed
        Seed of robot, effect, taps, material and noise; None: another at every run.
    effect
        Name of the effect to hide; None: one is drawn.
    seconds : s
        Duration of each recording.
    """

    out: Path
    noise: float = 0.01
    seed: int | None = None
    effect: str | None = None
    seconds: float = SECONDS


@dataclass(frozen=True)
class ConcealResult:
    """The hidden effect beside the diagnosis.

    Parameters
    ----------
    hidden
        The effect, from the opened seal.
    diagnosis
        Content of ``diagnosis.json``.
    fingerprint
        SHA-256 that was shown before the diagnosis.
    seconds : s
        Wall-clock time of the run.
    """

    hidden: ConcealedEffect
    diagnosis: dict[str, Any] = field(repr=False)
    fingerprint: str
    seconds: float


def run_concealed(
    options: ConcealOptions, progress: Progress = silent, say: Callable[[str], object] = str
) -> ConcealResult:
    """Hide, seal, tap, mill, diagnose in a process of its own, open.

    Raises
    ------
    InputError
        Options that cannot be, or a folder that cannot be made.
    MillfrfError
        The diagnosis failed, or the sealed file was touched.
    """
    started = time.perf_counter()
    recordings = _folder(options)
    seeds = np.random.SeedSequence(secrets.randbits(64) if options.seed is None else options.seed)
    robot_seed, effect_seed, *noise_seeds = (int(one.generate_state(1)[0]) for one in seeds.spawn(10))
    robot = posture_robot(np.random.default_rng(robot_seed))
    say("tapping a robot at rest, and fitting its nominal model ...")
    nominal = _tap(robot, recordings / "taps.h5", options, noise_seeds.pop(), progress)
    say("hiding one effect ...")
    forces = {level: milling_force(robot, level, options.seconds, noise_seeds.pop()) for level in LEVELS}
    effect = _draw(robot, forces["mid"], options, np.random.default_rng(effect_seed))
    sealed = seal(options.out / "sealed.bin", effect.to_json())
    say(f"sealed in {sealed.path}; SHA-256 of what is hidden: {sealed.fingerprint}")
    say(f"milling at {len(LEVELS)} levels, {options.seconds:g} s each ...")
    milled = []
    for level, force in forces.items():
        cell = ConcealedCell(robot, force, effect, options.noise, noise_seeds.pop())
        milled.append(_record(cell, recordings / f"{level}.h5", progress))
    del effect
    say("diagnosing, in a process that is given the nominal model and the recordings ...")
    diagnosis = _diagnose(nominal, milled, options.out / "diagnosis", say)
    hidden = ConcealedEffect(**_with_tuple(open_seal(sealed)))
    return ConcealResult(hidden, diagnosis, sealed.fingerprint, time.perf_counter() - started)


def _folder(options: ConcealOptions) -> Path:
    if not (math.isfinite(options.noise) and 0 < options.noise < 1):
        raise InputError(f"noise {options.noise!r} must lie between 0 and 1 (0.01: 1 % of the signal)")
    if options.seed is not None and options.seed < 0:
        raise InputError(f"seed {options.seed} must be zero or more")
    recordings = options.out / "recordings"
    try:
        recordings.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make the folder {options.out}: {error.strerror}; choose another --out") from error
    return recordings


def _tap(robot: ModalModel, path: Path, options: ConcealOptions, seed: int, progress: Progress) -> Path:
    """The nominal model file: hammer taps at the tip, H1, poly-reference fit.

    Its residual terms are dropped: a robot stands on a floor, so that what they add near 0 Hz, where forces of milling
    have their mean and taps have little power, would only be noise.
    """
    sensors = dynamometer(options.noise, 2000.0) + tip_accelerometers(options.noise, high_pass_hz=None)
    taps = _record(HammerCell(robot, sample_rate=TAP_RATE, sensors=sensors, seed=seed), path, progress)
    estimate = estimate_recordings([taps], TAPS, progress)
    write_estimate(options.out / "frf_taps.h5", estimate, [taps])
    nominal = options.out / "nominal.json"
    fit = fit_model(estimate.frf, TAP_FIT, progress)
    fit = replace(fit, model=replace(fit.model, residuals=None))
    write_fit(nominal, fit, [options.out / "frf_taps.h5"], TAP_FIT)
    return nominal


def _draw(
    robot: ModalModel, force: np.ndarray, options: ConcealOptions, generator: np.random.Generator
) -> ConcealedEffect:
    raw = generator.standard_normal(3)
    drawn = draw_name(generator)
    motion = tip_motion(robot, force, 1 / FINE_RATE)
    scale = joint_scale(robot, motion, raw / np.linalg.norm(raw), options.seconds)
    return draw_effect(options.effect or drawn, generator, scale)


def _record(source: HammerCell | ConcealedCell, path: Path, progress: Progress) -> Path:
    with progress(f"recording {path.stem}", source.n_samples) as update, writing_whole_file(path) as unfinished:
        record(source, unfinished, progress=update, provenance=made("demo", []))
    return path


def _diagnose(nominal: Path, milled: list[Path], out: Path, say: Callable[[str], object]) -> dict[str, Any]:
    """Run ``millfrf diagnose`` and read what it wrote."""
    written = out / "diagnosis.json"
    written.unlink(missing_ok=True)
    command = [sys.executable, "-m", "millfrf", "diagnose", *map(str, (nominal, *milled)), "--out", str(out), "--force"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode or not written.exists():
        last = (run.stderr.strip() or run.stdout.strip() or "no message").splitlines()[-1]
        raise MillfrfError(f"the diagnosis ended with {run.returncode}: {last}")
    for line in run.stdout.splitlines():
        say(f"  {line}")
    content: dict[str, Any] = json.loads(written.read_text(encoding="utf-8"))
    return content


def _with_tuple(content: dict[str, Any]) -> dict[str, Any]:
    direction = content["direction"]
    return content | {"direction": None if direction is None else tuple(direction)}
