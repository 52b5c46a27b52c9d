"""Sets of a campaign written to temporary files, from modal models with known truth."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from millfrf.campaign.results.sets import MeasuredSet
from millfrf.core import TIP
from millfrf.stability import StabilityLobes, write_lobes
from modal_fit import ModalModel, ModeErrors, write_modal_model

Real = NDArray[np.float64]


def model_of(frequencies: Sequence[float], damping: Sequence[float], shapes: Real, errors: Real | None) -> ModalModel:
    """A reciprocal model at the tip; ``shapes`` (n_modes, 3) in kg^-1/2, ``errors`` (n_modes, 2) absolute."""
    natural, zeta = 2 * np.pi * np.asarray(frequencies), np.asarray(damping)
    damped = natural * np.sqrt(1 - zeta**2)
    right = np.asarray(shapes, dtype=complex)
    nothing = None if errors is None else 0 * errors
    return ModalModel(
        -zeta * natural + 1j * damped,
        right,
        right / (2j * damped[:, None]),
        TIP,
        TIP,
        band=(0.5 * float(min(frequencies)), 1.5 * float(max(frequencies))),
        errors=None if errors is None or nothing is None else ModeErrors(errors, nothing + np.nan, nothing, nothing),
    )


SHAPES = np.array([[0.05, 0.01, 0.0], [0.01, 0.06, 0.01], [0.0, 0.01, 0.05]])


@dataclass
class WrittenCampaign:
    """Writes sets into a folder, one call a set."""

    folder: Path
    sets: list[MeasuredSet] = field(default_factory=list)

    def add(
        self,
        labels: Mapping[str, str | float],
        model: ModalModel | None,
        *,
        posture: tuple[float, ...] | None = None,
        recorded_at: float | None = None,
        depths: Sequence[float] | None = None,
        failures: tuple[str, ...] = (),
    ) -> MeasuredSet:
        name = " ".join(
            [
                str(labels["pose"]),
                *(f"{k}={v:g}" if isinstance(v, float) else f"{k}={v}" for k, v in labels.items() if k != "pose"),
            ]
        )
        stem = self.folder / f"{len(self.sets):03d}"
        model_file = lobes_file = None
        if model is not None:
            model_file = stem.with_suffix(".json")
            write_modal_model(model_file, model)
        if depths is not None:
            lobes_file = stem.with_suffix(".csv")
            speeds = np.linspace(100, 200, len(depths))
            kinds = tuple("hopf" if np.isfinite(depth) else "none" for depth in depths)
            chatter = np.where(np.isfinite(depths), 20.0, np.nan)
            write_lobes(lobes_file, StabilityLobes(speeds, np.asarray(depths), chatter, kinds, "nyquist"))
        single = MeasuredSet(
            name, dict(labels), posture, recorded_at, (f"{name}.h5",), model_file, lobes_file, None, failures
        )
        self.sets.append(single)
        return single


@pytest.fixture
def campaign(tmp_path: Path) -> WrittenCampaign:
    files = tmp_path / "files"
    files.mkdir()
    return WrittenCampaign(files)


@pytest.fixture
def modelled() -> Callable[..., ModalModel]:
    return model_of


@pytest.fixture
def shapes() -> Real:
    return SHAPES.copy()
