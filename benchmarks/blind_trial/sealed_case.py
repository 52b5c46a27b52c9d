"""Case folders for the tool, and truths that stay sealed until it has run.

The truth is written apart, as canonical JSON; its SHA-256 goes into the case folder before the tool sees the case.
A salt keeps the hash from being found by trying all answers.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import Channel, RecordingWriter, StreamDescription
from modal_fit import write_modal_model

from .case_spec import CaseSpec
from .excitation import RATE
from .simulation import Case, build_case

FORMAT = "millfrf.blind_trial.truth"


def case_name(index: int) -> str:
    """Folder of a case."""
    return f"case_{index:05d}"


def write_case(spec: CaseSpec, out: Path) -> Path:
    """Simulate a case, seal its truth in ``out/sealed``, write what a lab would have to ``out/cases``; that folder."""
    case = build_case(spec)
    name = case_name(spec.index)
    folder, sealed = out / "cases" / name, out / "sealed"
    folder.mkdir(parents=True, exist_ok=True)
    sealed.mkdir(parents=True, exist_ok=True)
    content = truth_bytes(spec, case.truth)
    (sealed / f"{name}.json").write_bytes(content)
    write_modal_model(folder / "nominal.json", case.nominal)
    _write_recordings(case, folder)
    seal = {"format": "millfrf.blind_trial.seal", "sha256_of_truth": hashlib.sha256(content).hexdigest()}
    (folder / "seal.json").write_text(json.dumps(seal, indent=1) + "\n", encoding="utf-8")
    return folder


def truth_bytes(spec: CaseSpec, truth: dict[str, Any]) -> bytes:
    """The truth as canonical JSON: sorted keys, no spaces, a salt."""
    salt = hashlib.sha256(f"blind trial {spec.seed} {spec.index}".encode()).hexdigest()
    content = {"format": FORMAT, "format_version": 1, "salt": salt, **truth}
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()


def open_truth(out: Path, name: str) -> dict[str, Any]:
    """Open a sealed truth.

    Raises
    ------
    ValueError
        It is not the one whose hash was given to the tool's side.
    """
    content = (out / "sealed" / f"{name}.json").read_bytes()
    promised = json.loads((out / "cases" / name / "seal.json").read_text(encoding="utf-8"))["sha256_of_truth"]
    if hashlib.sha256(content).hexdigest() != promised:
        raise ValueError(f"{name}: the truth was changed after it had been sealed")
    opened: dict[str, Any] = json.loads(content)
    return opened


def _write_recordings(case: Case, folder: Path) -> None:
    missing = case.truth.get("missing_channel", "")
    for level, samples in case.recordings.items():
        names = [name for name in ("fx", "fy", "fz", "ax", "ay", "az") if name != missing]
        kept = [k for k, name in enumerate(("fx", "fy", "fz", "ax", "ay", "az")) if name != missing]
        channels = tuple(_channel(name, case.node) for name in names)
        stream = StreamDescription("main", float(RATE), 0.0, channels)
        title = "milling test" if level == "unseen" else f"milling test, {level} level"
        with RecordingWriter(
            folder / f"{level}.h5", [stream], title=title, recorded_at="2026-01-01T00:00:00Z", overwrite=True
        ) as writer:
            writer.append("main", np.ascontiguousarray(samples[:, kept]))


def _channel(name: str, node: str) -> Channel:
    direction = f"+{name[1].upper()}"
    if name.startswith("f"):
        return Channel(name, "force", "N", "TCP", direction)
    return Channel(name, "acceleration", "m/s^2", node, direction)
