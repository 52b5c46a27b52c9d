"""Step ``cut simulate``: a cut in the time domain, with loss of contact, as recording, picture and sound."""

import math
import os
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge

from acquisition import Channel, RecordingWriter, StreamDescription
from millfrf.core import TIP, InputError, Real, writing_whole_file
from millfrf.core.progress import progress
from millfrf.core.provenance import made
from millfrf.core.steps import File, Typed, Writes, step
from millfrf.core.terminal import say, say_written, tell, warn
from millfrf.cutting import MillingProcess
from millfrf.gate import check_depth, check_model, rigid_directions
from millfrf.stability import (
    SimulatedCut,
    SpeedVariation,
    delay_system,
    multipliers,
    simulate_cut,
    turns_to_settle,
    varied_speed_radius,
)
from modal_fit import ModalModel

from .given import (
    CutGiven,
    Depth,
    ModelGiven,
    Picture,
    Speed,
    Variation,
    WorkpieceGiven,
    files_among,
    model_of,
    process_of,
    relative_to,
)
from .settings import RPM

SOUND_RATE = 44_100  # Hz


@step
def cut_simulate(
    model: ModelGiven,
    /,
    cutting: CutGiven,
    *,
    speed: Speed,
    depth: Depth,
    revolutions: Annotated[int, Typed("N"), Ge(1)] | None = None,
    variation: Variation | None = None,
    workpiece: WorkpieceGiven = None,
    out: Annotated[File | None, Writes(suffixes=(".h5",), needed=True)] = None,
    picture: Picture = None,
    sound: Annotated[File | None, Writes(suffixes=(".wav",))] = None,
) -> SimulatedCut:
    """Simulate a cut in the time domain: motion, force and wall, with edges that jump out of the cut.

    The tool starts from rest. Any cutter is simulated: helix, unequal pitch, ball, serrations, runout and process
    damping.

    Parameters
    ----------
    model
        Modal model at the tool tip.
    cutting
        Cutter, engagement and force coefficients.
    speed : rpm
        Spindle speed; the mean one with a variation.
    depth : m
        Axial depth of cut.
    revolutions
        Turns of the spindle; without it as many as the slowest mode needs to settle, at least 40, and more while a
        motion that does not repeat decays.
    variation
        Sinusoidal variation of the speed: its share of the speed, and how often in a revolution; without it none.
    workpiece
        Modal model of a workpiece that moves, too, where the cut is, in the same directions; without it the workpiece
        is rigid.
    out
        Recording of force and motion at the tool tip to write.
    picture
        Picture of motion, force and chip to write.
    sound
        Sound of the motion to write: the tip's velocity.

    Returns
    -------
    SimulatedCut
        Motion, force, chips and walls.

    Raises
    ------
    InputError
        A model, a cut, a speed or a depth that cannot be used.

    Examples
    --------
    ::

        $ millfrf cut simulate tip.json --cutting cut.toml --speed 3000 --depth 0.002 --out simulated.h5
    """
    tool, name, stored = model_of(model)
    structure, of_workpiece = relative_to(tool, workpiece)
    assert isinstance(structure, ModalModel)
    process, warnings = process_of(cutting)
    warnings = [
        *stored, *of_workpiece, *warnings, *check_depth(depth, process, "depth"), *check_model(structure, str(name)),
        *rigid_directions(structure),
    ]  # fmt: skip
    varied = None if variation is None else SpeedVariation(*variation)
    with progress("simulating the cut"):
        result = simulate_cut(structure, process, speed * RPM, depth, turns=revolutions, variation=varied)
    doubt = _doubt(structure, process, result, (speed * RPM, depth), varied)
    if out is not None:
        inputs = files_among(model, cutting, workpiece)
        options = {"speed_rpm": speed, "depth_m": depth, "revolutions": revolutions, "variation": variation}
        _write(out, result, made("cut simulate", inputs, options), speed, depth)
    if picture is not None:
        from millfrf.figures import save_figure, simulated_figure

        save_figure(simulated_figure(result), Path(picture))
    if sound is not None:
        _write_sound(sound, result)
    warn(warnings)
    tell(lambda: simulated_answer(result, doubt))
    for line in simulated_lines(result, doubt):
        say(line)
    say_written([file for file in (out, picture, sound) if file is not None])
    return result


def _doubt(
    model: ModalModel,
    process: MillingProcess,
    cut: SimulatedCut,
    condition: tuple[float, float],
    varied: SpeedVariation | None,
) -> str:
    """Compare a simulated cut with its Floquet multipliers, the second witness; empty if they agree.

    ``condition``: spindle speed (rad/s) and depth (m).
    """
    speed, depth = condition
    turns, needed = len(cut.times) // cut.steps, turns_to_settle(delay_system(model, process), speed)
    is_short = turns < needed and math.isfinite(cut.unsteadiness)
    if not (cut.repeats or is_short):
        return ""
    try:
        if varied is not None:
            stable = varied_speed_radius(model, process, speed, depth, varied) < 1
        else:
            stable = multipliers(model, process, speed, depth).stable
    except InputError as error:
        unknown = f"the simulated motion repeats, but its Floquet multipliers are not known ({error})"
        return unknown if cut.repeats else ""
    if cut.repeats and not stable:
        return (
            "the simulated motion repeats, but its Floquet multipliers say that it is not stable: chatter may repeat "
            "every turn where teeth differ, or grow slowly; cut less deep, or compare with millfrf lobes"
        )
    if stable and not cut.repeats:
        return (
            f"{cut.outcome}, but its Floquet multipliers are stable: it has not settled; give --revolutions {needed} "
            "or more"
        )
    return ""


def _write(out: str | os.PathLike[str], cut: SimulatedCut, origin: str, speed: float, depth: float) -> None:
    """Write force and motion as a recording of equally spaced samples."""
    rate = len(cut.times) / float(cut.times[-1])
    times = np.arange(1, len(cut.times) + 1) / rate
    channels, columns = [], []
    for kind, unit, values in (("force", "N", cut.force), ("displacement", "m", cut.motion)):
        for axis, point in enumerate(TIP):
            if kind == "displacement" and not values[:, axis].any():  # rigid there
                continue
            node, _, direction = point.partition(":")
            channels.append(Channel(f"{kind[0].upper()}{'xyz'[axis]}", kind, unit, node, direction))
            columns.append(np.interp(times, cut.times, values[:, axis]))
    stream = StreamDescription("simulated", rate, 1 / rate, tuple(channels))
    setup = f"[cut]\nspindle_speed_rpm = {speed!r}\ndepth_m = {depth!r}\nsimulated = true\n"
    title = f"simulated cut at {speed:g} rpm, {1e3 * depth:g} mm deep"
    with (
        writing_whole_file(out) as temporary,
        RecordingWriter(temporary, (stream,), title=title, setup=setup, provenance=origin) as writer,
    ):
        writer.append("simulated", np.column_stack(columns))


def _write_sound(out: str | os.PathLike[str], cut: SimulatedCut) -> None:
    """Write the tip's velocity in Y, or along the axis that moves most, as a sound whose peak is four fifths."""
    from scipy.io import wavfile

    axis = int(np.argmax(np.std(cut.motion, axis=0)))
    velocity = np.gradient(cut.motion[:, axis], cut.times)
    times = np.arange(math.ceil(cut.times[-1] * SOUND_RATE)) / SOUND_RATE
    wave = np.interp(times, cut.times, velocity)
    peak = float(np.abs(wave).max())
    if not peak > 0:
        raise InputError("the tool does not move: there is no sound to write")
    with writing_whole_file(out) as temporary:
        wavfile.write(temporary, SOUND_RATE, np.asarray(0.8 * 32767 * wave / peak, dtype=np.int16))


def _late(cut: SimulatedCut, values: Real) -> Real:
    return values[-max(cut.steps, len(values) // 4) :]


def simulated_lines(cut: SimulatedCut, doubt: str = "") -> list[str]:
    """Sentences on whether the cut is stable, how large its motion is, and where the wall is left; ``doubt`` of it."""
    motion, force = _late(cut, cut.motion), np.linalg.norm(_late(cut, cut.force), axis=1)
    span = 1e6 * (motion.max(axis=0) - motion.min(axis=0))
    if doubt:
        verdict = f"undecided: {doubt}"
    elif cut.repeats:
        verdict = f"stable: {cut.outcome}"
    else:
        verdict = f"not stable: {cut.outcome}"
    lines = [verdict, "motion from peak to peak: " + ", ".join(f"{'XYZ'[k]} {span[k]:.3g} µm" for k in range(3))]
    lines.append(f"largest force {force.max():.4g} N")
    for wall, words in enumerate(("at immersion 0 (up milling)", "at immersion 180 deg (down milling)")):
        last = cut.walls[-2 if len(cut.walls) > 1 else -1, wall]
        if np.isfinite(last).all() and cut.repeats and not doubt:
            low, high = 1e6 * last.min(), 1e6 * last.max()
            lines.append(f"wall {words}: {low:+.3g} to {high:+.3g} µm from its place (+: too much is removed)")
    return lines


def simulated_answer(cut: SimulatedCut, doubt: str = "") -> dict[str, Any]:
    """Numbers of a simulated cut for JSON; ``stable`` is null where the multipliers do not confirm it."""
    motion = _late(cut, cut.motion)
    return {
        "stable": None if doubt else cut.repeats,
        "unsteadiness": cut.unsteadiness,
        "peak_to_peak_m": dict(zip("XYZ", motion.max(axis=0) - motion.min(axis=0), strict=True)),
        "largest_force_n": float(np.linalg.norm(_late(cut, cut.force), axis=1).max()),
        "turns": len(cut.times) // cut.steps,
    }
