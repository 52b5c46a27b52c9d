"""The concealed demonstration: one effect is hidden and sealed, and the diagnosis looks for it."""

import hashlib
import json
import math
import secrets
import subprocess
import sys
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import record
from millfrf.core import InputError, MillfrfError, writing_whole_file
from millfrf.core.progress import progress
from millfrf.core.provenance import made
from millfrf.core.terminal import Table, note, silently
from millfrf.steps.estimate import estimate
from millfrf.steps.fit import FitOptions, fit, write_fit
from modal_fit import ModalModel
from replay_data import (
    FINE_RATE,
    FOREIGN,
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

PADDED = 4096
"""Bytes of every sealed file, so that its length tells nothing."""


@dataclass(frozen=True)
class Seal:
    """Key and fingerprint that close and open a sealed file: a one-time pad, and a hash of the content.

    Parameters
    ----------
    path
        The sealed file.
    key
        As long as the file (Shannon 1949: without it the file tells nothing).
    fingerprint
        SHA-256 of the salted content, hexadecimal; to be shown beforehand.
    """

    path: Path
    key: bytes
    fingerprint: str

    def __repr__(self) -> str:
        """Show the seal without its key."""
        return f"Seal({self.path}, {self.fingerprint})"


def seal(path: Path, content: dict[str, Any]) -> Seal:
    """Write content so that only the seal returned can read it.

    Raises
    ------
    InputError
        The content is too long, or the file cannot be written.
    """
    salted = json.dumps({"salt": secrets.token_hex(32), **content}, allow_nan=False).encode()
    if len(salted) > PADDED:
        raise InputError(f"{len(salted)} bytes to seal; {PADDED} are the most")
    plain = salted.ljust(PADDED)
    key = secrets.token_bytes(PADDED)
    with writing_whole_file(path) as temporary:
        temporary.write_bytes(_either(plain, key))
    return Seal(path, key, hashlib.sha256(plain).hexdigest())


def open_seal(sealed: Seal) -> dict[str, Any]:
    """Give the content under the seal.

    Raises
    ------
    InputError
        The file is gone, or is no longer what was sealed.
    """
    try:
        hidden = sealed.path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read the sealed file {sealed.path}: {error.strerror}") from error
    plain = _either(hidden, sealed.key) if len(hidden) == PADDED else b""
    if hashlib.sha256(plain).hexdigest() != sealed.fingerprint:
        raise InputError(f"{sealed.path} has been changed since it was sealed; run the demonstration again")
    content: dict[str, Any] = json.loads(plain)
    del content["salt"]
    return content


def _either(one: bytes, other: bytes) -> bytes:
    return bytes(a ^ b for a, b in zip(one, other, strict=True))


SECONDS = 48.0
TAP_RATE = 2048.0
TAP_FIT = FitOptions((6.0, 45.0), "polyreference", None, None, (), (), None, None, False)


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


def run_concealed(options: ConcealOptions) -> ConcealResult:
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
    note("tapping a robot at rest, and fitting its nominal model ...")
    nominal = _tap(robot, recordings / "taps.h5", options, noise_seeds.pop())
    note("hiding one effect ...")
    forces = {level: milling_force(robot, level, options.seconds, noise_seeds.pop()) for level in LEVELS}
    effect = _draw(robot, forces["mid"], options, np.random.default_rng(effect_seed))
    sealed = seal(options.out / "sealed.bin", effect.to_json())
    note(f"sealed in {sealed.path}; SHA-256 of what is hidden: {sealed.fingerprint}")
    note(f"milling at {len(LEVELS)} levels, {options.seconds:g} s each ...")
    milled = []
    for level, force in forces.items():
        cell = ConcealedCell(robot, force, effect, options.noise, noise_seeds.pop())
        milled.append(_record(cell, recordings / f"{level}.h5"))
    del effect
    note("diagnosing, in a process that is given the nominal model and the recordings ...")
    diagnosis = _diagnose(nominal, milled, options.out / "diagnosis")
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


def _tap(robot: ModalModel, path: Path, options: ConcealOptions, seed: int) -> Path:
    """The nominal model file: hammer taps at the tip, H1, poly-reference fit.

    Its residual terms are dropped: a robot stands on a floor, so that what they add near 0 Hz, where forces of milling
    have their mean and taps have little power, would only be noise.
    """
    sensors = dynamometer(options.noise, 2000.0) + tip_accelerometers(options.noise, high_pass_hz=None)
    taps = _record(HammerCell(robot, sample_rate=TAP_RATE, sensors=sensors, seed=seed), path)
    frf, nominal = options.out / "frf_taps.h5", options.out / "nominal.json"
    with silently():
        estimate(taps, segment=4.0, overlap=0.0, window="boxcar", band=(1.0, 200.0), out=frf)
        fitted = fit(frf, band=TAP_FIT.band)
    write_fit(nominal, replace(fitted, model=replace(fitted.model, residuals=None)), [frf], TAP_FIT)
    return nominal


def _draw(
    robot: ModalModel, force: np.ndarray, options: ConcealOptions, generator: np.random.Generator
) -> ConcealedEffect:
    raw = generator.standard_normal(3)
    drawn = draw_name(generator)
    motion = tip_motion(robot, force, 1 / FINE_RATE)
    scale = joint_scale(robot, motion, raw / np.linalg.norm(raw), options.seconds)
    return draw_effect(options.effect or drawn, generator, scale)


def _record(source: HammerCell | ConcealedCell, path: Path) -> Path:
    with progress(f"recording {path.stem}", source.n_samples) as update, writing_whole_file(path) as unfinished:
        record(source, unfinished, progress=update, provenance=made("demo", []))
    return path


def _diagnose(nominal: Path, milled: list[Path], out: Path) -> dict[str, Any]:
    """Run ``millfrf diagnose`` and read what it wrote."""
    written = out / "diagnosis.json"
    written.unlink(missing_ok=True)
    command = [sys.executable, "-m", "millfrf", "diagnose", *map(str, (nominal, *milled)), "--out", str(out), "--force"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode or not written.exists():
        last = (run.stderr.strip() or run.stdout.strip() or "no message").splitlines()[-1]
        raise MillfrfError(f"the diagnosis ended with {run.returncode}: {last}")
    for line in run.stdout.splitlines():
        note(f"  {line}")
    content: dict[str, Any] = json.loads(written.read_text(encoding="utf-8"))
    return content


def _with_tuple(content: dict[str, Any]) -> dict[str, Any]:
    direction = content["direction"]
    return content | {"direction": None if direction is None else tuple(direction)}


def found_names(diagnosis: dict[str, Any]) -> tuple[str, ...]:
    """Names of the accepted causes."""
    return tuple(cause["name"] for cause in diagnosis["physics"])


def judgement(hidden: str, diagnosis: dict[str, Any]) -> str:
    """How an answer stands to what was hidden.

    ``right``, ``right, in part`` (named, with more left than it may), ``right within a class``, ``right, and more``,
    ``abstained``, ``missed`` or ``wrong``.
    """
    names, verdict = found_names(diagnosis), diagnosis["verdict"]
    if hidden == FOREIGN:
        return "right" if verdict == "unexplained" else "missed" if verdict == "none" else "wrong"
    if hidden == "none":
        return {"none": "right", "unexplained": "abstained"}.get(verdict, "wrong")
    if verdict == "unexplained":
        return "abstained"
    if names == (hidden,):
        return "right" if verdict == "explained" else "right, in part"
    if hidden in names:
        return "right, and more"
    if verdict == "none":
        return "missed"
    return "right within a class" if hidden in diagnosis["equivalents"] else "wrong"


def direction_error(hidden: ConcealedEffect, diagnosis: dict[str, Any]) -> float | None:
    """Angle between the hidden joint and the one found, 0 to 90 deg; None where one of them has no direction."""
    for cause in diagnosis["physics"]:
        found = cause["location"].get("direction")
        if found is not None and hidden.direction is not None:
            cosine = abs(float(np.dot(found, hidden.direction))) / float(np.linalg.norm(found))
            return math.degrees(math.acos(min(1.0, cosine)))
    return None


def concealment_table(result: ConcealResult) -> Table:
    """Rows: what, where, numbers; error on held-out data; judgement."""
    hidden, diagnosis = result.hidden, result.diagnosis
    causes, gain = diagnosis["physics"], diagnosis["improvement"]
    angle = direction_error(hidden, diagnosis)
    places = "; ".join(_place(cause["location"]) for cause in causes)
    rows = [
        ("verdict", "none" if hidden.name == "none" else "explained", str(diagnosis["verdict"])),
        ("effect", hidden.name, ", ".join(found_names(diagnosis)) or "none"),
        ("where", "" if hidden.direction is None else _place({"direction": hidden.direction}), places),
        ("direction error", "", "" if angle is None else f"{angle:.1f} deg"),
        ("numbers", _numbers(hidden.parameters), "\n".join(_with_errors(cause) for cause in causes)),
        ("cannot be told from", "", ", ".join(diagnosis["equivalents"])),
        ("error held out", "", f"{100 * gain['before']:.3g} % to {100 * gain['after']:.3g} %"),
        ("noise there", "", f"{100 * gain['noise_floor']:.3g} %"),
        ("judgement", "", judgement(hidden.name, diagnosis)),
    ]
    if hidden.name == FOREIGN:
        rows[0] = ("verdict", "unexplained (no library has it)", str(diagnosis["verdict"]))
    return Table("The seal is open", ("", "hidden", "found"), tuple(rows))


def _place(location: dict[str, Any]) -> str:
    return ", ".join(
        f"[{', '.join(f'{part:+.3f}' for part in value)}]" if key == "direction" else str(value)
        for key, value in location.items()
    )


def _numbers(parameters: dict[str, Any]) -> str:
    return "\n".join(f"{name} {_number(value)}" for name, value in parameters.items())


def _with_errors(cause: dict[str, Any]) -> str:
    """Numbers that were found with their standard errors."""
    errors = cause.get("standard_errors", {})
    return "\n".join(
        f"{name} {_number(value)}" + (f" ± {errors[name]:.2g}" if name in errors else "")
        for name, value in cause["parameters"].items()
    )


def _number(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_number(part) for part in value) + "]"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
