"""The blind demonstration: one effect is stated in a sealed file only, and the diagnosis must find it."""

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
from millfrf.mismatch import NAMELESS
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

PADDED = 4096  # bytes of every sealed file: its length must not reveal the effect


@dataclass(frozen=True)
class Seal:
    """One-time pad and hash of a sealed file."""

    path: Path
    key: bytes  # one-time pad as long as the file (Shannon 1949: perfect secrecy)
    fingerprint: str  # SHA-256 (hexadecimal) of the salted content; shown before the diagnosis

    def __repr__(self) -> str:
        return f"Seal({self.path}, {self.fingerprint})"


def seal(path: Path, content: dict[str, Any]) -> Seal:
    """Encrypt and write content that only the returned seal can read."""
    salted = json.dumps({"salt": secrets.token_hex(32), **content}, allow_nan=False).encode()
    if len(salted) > PADDED:
        raise InputError(f"{len(salted)} bytes to seal; {PADDED} are the most")
    plain = salted.ljust(PADDED)
    key = secrets.token_bytes(PADDED)
    with writing_whole_file(path) as temporary:
        temporary.write_bytes(_either(plain, key))
    return Seal(path, key, hashlib.sha256(plain).hexdigest())


def open_seal(sealed: Seal) -> dict[str, Any]:
    """Read the content of a sealed file."""
    try:
        encrypted = sealed.path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read the sealed file {sealed.path}: {error.strerror}") from error
    plain = _either(encrypted, sealed.key) if len(encrypted) == PADDED else b""
    if hashlib.sha256(plain).hexdigest() != sealed.fingerprint:
        raise InputError(f"{sealed.path} has been changed since it was sealed; run the demonstration again")
    content: dict[str, Any] = json.loads(plain)
    del content["salt"]
    return content


def _either(first: bytes, second: bytes) -> bytes:
    return bytes(a ^ b for a, b in zip(first, second, strict=True))


SECONDS = 48.0
TAP_RATE = 2048.0
TAP_FIT = FitOptions((6.0, 45.0), "polyreference", None, None, (), (), None, None, False)


@dataclass(frozen=True)
class ConcealOptions:
    """Options of a blind demonstration."""

    out: Path  # folder of the files; created if missing
    noise: float = 0.01  # relative noise of accelerations; forces have half of it
    seed: int | None = None  # of all random numbers; None: random
    effect: str | None = None  # effect to hide; None: random
    seconds: float = SECONDS  # s, of each recording


@dataclass(frozen=True)
class ConcealResult:
    """The hidden effect and the diagnosis."""

    hidden: ConcealedEffect  # from the opened seal
    diagnosis: dict[str, Any] = field(repr=False)  # ``diagnosis.json``
    fingerprint: str  # SHA-256 shown before the diagnosis
    seconds: float  # s; wall-clock time of the run


def run_concealed(options: ConcealOptions) -> ConcealResult:
    """Tap a robot, seal one hidden effect, mill with it, diagnose it in a separate process, and open the seal."""
    started = time.perf_counter()
    recordings = _folder(options)
    seeds = np.random.SeedSequence(secrets.randbits(64) if options.seed is None else options.seed)
    robot_seed, effect_seed, *noise_seeds = (int(seed.generate_state(1)[0]) for seed in seeds.spawn(10))
    robot = posture_robot(np.random.default_rng(robot_seed))
    note("tapping a robot at rest, and fitting its nominal model ...")
    nominal = _tap(robot, recordings / "taps.h5", options, noise_seeds.pop())
    note("hiding one effect ...")
    forces = {level: milling_force(robot, level, options.seconds, noise_seeds.pop()) for level in LEVELS}
    effect = _draw(robot, forces["mid"], options, np.random.default_rng(effect_seed))
    sealed = seal(options.out / "sealed.bin", effect.to_json())
    note(f"sealed in {sealed.path}; SHA-256 of what is hidden: {sealed.fingerprint}")
    note(f"milling at {len(LEVELS)} levels, {options.seconds:g} s each ...")
    recorded = []
    for level, force in forces.items():
        cell = ConcealedCell(robot, force, effect, options.noise, noise_seeds.pop())
        recorded.append(_record(cell, recordings / f"{level}.h5"))
    del effect
    note("diagnosing, in a process that is given the nominal model and the recordings ...")
    diagnosis = _diagnose(nominal, recorded, options.out / "diagnosis")
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
    """Write the nominal model: a poly-reference fit to the H1 estimate from hammer taps at the tip.

    The residual terms of the model are removed. The robot stands on a floor, and near 0 Hz, where taps have little
    power, the terms would only add noise to the response to the mean milling force.
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


def _diagnose(nominal: Path, recorded: list[Path], out: Path) -> dict[str, Any]:
    """Run ``millfrf diagnose`` and read the diagnosis that it wrote."""
    result_file = out / "diagnosis.json"
    result_file.unlink(missing_ok=True)
    command = [
        sys.executable,
        "-m",
        "millfrf",
        "diagnose",
        *map(str, (nominal, *recorded)),
        "--out",
        str(out),
        "--force",
    ]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode or not result_file.exists():
        last = (run.stderr.strip() or run.stdout.strip() or "no message").splitlines()[-1]
        raise MillfrfError(f"the diagnosis ended with {run.returncode}: {last}")
    for line in run.stdout.splitlines():
        note(f"  {line}")
    content: dict[str, Any] = json.loads(result_file.read_text(encoding="utf-8"))
    return content


def _with_tuple(content: dict[str, Any]) -> dict[str, Any]:
    direction = content["direction"]
    return content | {"direction": None if direction is None else tuple(direction)}


def found_names(diagnosis: dict[str, Any]) -> tuple[str, ...]:
    return tuple(cause["name"] for cause in diagnosis["physics"])


def judgement(hidden: str, diagnosis: dict[str, Any]) -> str:
    """Grade a diagnosis against the hidden effect.

    ``right``, ``right, in part`` (correct cause, but the residual is too large), ``right within a class``, ``right, and
    more``, ``abstained``, ``missed`` or ``wrong``.
    """
    names, verdict = found_names(diagnosis), diagnosis["verdict"]
    if hidden == FOREIGN:
        return "right" if verdict in NAMELESS else "missed" if verdict == "none" else "wrong"
    if hidden == "none":
        return "right" if verdict == "none" else "abstained" if verdict in NAMELESS else "wrong"
    if verdict in NAMELESS:
        return "abstained"
    if names == (hidden,):
        return "right" if verdict == "explained" else "right, in part"
    if hidden in names:
        return "right, and more"
    if verdict == "none":
        return "missed"
    return "right within a class" if hidden in diagnosis["equivalents"] else "wrong"


def direction_error(hidden: ConcealedEffect, diagnosis: dict[str, Any]) -> float | None:
    """Return the angle (0 to 90 deg) between hidden and diagnosed joint; None if a joint has no direction."""
    for cause in diagnosis["physics"]:
        direction = cause["location"].get("direction")
        if direction is not None and hidden.direction is not None:
            cosine = abs(float(np.dot(direction, hidden.direction))) / float(np.linalg.norm(direction))
            return math.degrees(math.acos(min(1.0, cosine)))
    return None


def concealment_table(result: ConcealResult) -> Table:
    """Return a table of hidden and diagnosed effect, held-out error and grade."""
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
        ("equivalent", "", ", ".join(diagnosis["equivalents"])),
        ("error held out", "", f"{100 * gain['before']:.3g} % to {100 * gain['after']:.3g} %"),
        ("noise there", "", f"{100 * gain['noise_floor']:.3g} %"),
        ("judgement", "", judgement(hidden.name, diagnosis)),
    ]
    if hidden.name == FOREIGN:
        rows[0] = ("verdict", "unlisted or unexplained (no library has it)", str(diagnosis["verdict"]))
    return Table("The seal is open", ("", "hidden", "found"), tuple(rows))


def _place(location: dict[str, Any]) -> str:
    return ", ".join(
        f"[{', '.join(f'{component:+.3f}' for component in value)}]" if key == "direction" else str(value)
        for key, value in location.items()
    )


def _numbers(parameters: dict[str, Any]) -> str:
    return "\n".join(f"{name} {_number(value)}" for name, value in parameters.items())


def _with_errors(cause: dict[str, Any]) -> str:
    """Format the parameters of a cause with standard errors."""
    errors = cause.get("standard_errors", {})
    return "\n".join(
        f"{name} {_number(value)}" + (f" ± {errors[name]:.2g}" if name in errors else "")
        for name, value in cause["parameters"].items()
    )


def _number(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_number(item) for item in value) + "]"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
