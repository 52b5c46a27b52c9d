"""Fixtures of the diagnosis' tests: a small structure and recordings of it."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from mismatch import Trial
from modal_fit import ModalModel

_PATH = Path(__file__).with_name("concealed_recordings.py")
_SPEC = importlib.util.spec_from_file_location("concealed_recordings", _PATH)
assert _SPEC is not None
assert _SPEC.loader is not None
_MODULE = importlib.util.module_from_spec(_SPEC)
sys.modules["concealed_recordings"] = _MODULE
_SPEC.loader.exec_module(_MODULE)


@pytest.fixture(scope="session")
def model() -> ModalModel:
    return _MODULE.structure()


@pytest.fixture(scope="session")
def linear_trials() -> list[Trial]:
    rng = np.random.default_rng(3)
    made = []
    for name, level in (("low", 20.0), ("high", 60.0)):
        force = _MODULE.forces(rng, level, 24.0)
        made.append(_MODULE.trial(name, force, _MODULE.linear_acceleration(_MODULE.structure(), force), rng))
    return made
