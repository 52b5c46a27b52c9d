"""Recordings predicted by a robot that was fitted to the others."""

from dataclasses import replace

import numpy as np

from .posed_recording import halves
from .robot_receptance import predicted_lines
from .robot_results import HeldOut
from .robot_search import fit_from, free_fit
from .robot_setting import Changes, Setting


def held_out(setting: Setting, changes: Changes) -> tuple[HeldOut, ...]:
    """Each recording predicted by a robot fitted to the others; a single one is cut in two."""
    if len(setting.recordings) == 1:
        setting = replace(setting, recordings=halves(setting.recordings[0]), counts=setting.counts * 2)
    result = []
    for left_out, recording in enumerate(setting.recordings):
        others = setting.only([i for i in range(len(setting.recordings)) if i != left_out])
        alone = setting.only([left_out])
        fitted: Changes = ()
        if changes:
            fitted = fit_from(others, changes, free_fit(others, changes)).changes
        free = free_fit(alone, changes)
        measured = recording.lines.measured
        parts = (alone.modes(())[0], alone.modes(fitted)[0], free.fitted.modes[0])
        errors = [float(np.linalg.norm(measured - predicted_lines(modes, recording.lines))) for modes in parts]
        whole = float(np.linalg.norm(measured))
        result.append(HeldOut(recording.name, *(one / whole for one in errors)))
    return tuple(result)
