"""A Gaussian process over joint angles that knows no robot: the rival, from scikit-learn."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from modal_fit import ModalModel

Real = NDArray[np.float64]


@dataclass(frozen=True)
class PlainProcess:
    """Processes of the logarithm of each mode's frequency and damping, modes by number, and of the depth limit."""

    frequencies: tuple[GaussianProcessRegressor, ...]
    ratios: tuple[GaussianProcessRegressor, ...]
    limits: GaussianProcessRegressor | None

    def frequency(self, mode: int, q: Real) -> tuple[float, Real]:
        """Natural frequency of a mode and the ends of its 95 % band, Hz."""
        return _band(self.frequencies[mode], q)

    def damping(self, mode: int, q: Real) -> tuple[float, Real]:
        """Damping ratio of a mode and the ends of its 95 % band."""
        return _band(self.ratios[mode], q)

    def depth(self, q: Real) -> tuple[float, Real]:
        """Depth limit and the ends of its 95 % band, m."""
        assert self.limits is not None
        return _band(self.limits, q)


def plain_process(
    postures: Real, models: Sequence[ModalModel], depth: Callable[[ModalModel], float] | None
) -> PlainProcess:
    """Fit all processes; ``depth`` gives a model's depth limit."""
    modes = range(len(models[0].poles))
    return PlainProcess(
        tuple(_fitted(postures, [np.log(model.natural_frequencies[i]) for model in models]) for i in modes),
        tuple(_fitted(postures, [np.log(model.damping_ratios[i]) for model in models]) for i in modes),
        None if depth is None else _fitted(postures, [np.log(depth(model)) for model in models]),
    )


def _fitted(postures: Real, values: Sequence[float]) -> GaussianProcessRegressor:
    width = 2 * postures.shape[1]
    kernel = ConstantKernel(1.0) * RBF(np.full(width, 1.0), (0.1, 100.0)) + WhiteKernel(0.01, (1e-6, 1.0))
    process = GaussianProcessRegressor(kernel, normalize_y=True, n_restarts_optimizer=2, random_state=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        process.fit(_features(postures), np.array(values))
    return process


def _features(postures: Real) -> Real:
    return np.hstack([np.sin(postures), np.cos(postures)])


def _band(process: GaussianProcessRegressor, q: Real) -> tuple[float, Real]:
    mean, spread = process.predict(_features(q[None]), return_std=True)
    return float(np.exp(mean[0])), np.exp(mean[0] + 1.96 * spread[0] * np.array([-1.0, 1.0]))
