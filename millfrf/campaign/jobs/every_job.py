"""Every kind of task and the function that does it."""

from collections.abc import Callable
from pathlib import Path

from .diagnose import diagnose
from .estimate import estimate
from .fit import calibrate, fit
from .lobes import lobes
from .report import report
from .robot_jobs import learn, robot_diagnose
from .sound_recordings import check
from .spectra import add, join, spectra
from .work import Work

JOB_OF: dict[str, Callable[[Work, Path], list[str]]] = {
    "check": check,
    "spectra": spectra,
    "join": join,
    "sum": add,
    "estimate": estimate,
    "fit": fit,
    "calibrate": calibrate,
    "lobes": lobes,
    "diagnose": diagnose,
    "robot_diagnose": robot_diagnose,
    "learn": learn,
    "report": report,
}
"""A job writes its files into a folder that is there, and returns doubts; what it refuses it raises."""
