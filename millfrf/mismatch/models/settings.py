"""Thresholds of the fits of a structure, and of the tests whether a residual is noise."""

from dataclasses import dataclass

from ..inference.settings import Thresholds


@dataclass(frozen=True)
class FitSettings(Thresholds, shares=("plain_error", "restart_error", "below_noise")):
    """How hypotheses about a structure are fitted.

    Parameters
    ----------
    thinned_lines
        If a recording has more lines than this, a fit begins with so many of its lines.
    iterations, restart_iterations
        Largest number of steps of a fit to convergence, and of one that starts again by plain least squares.
    tolerance, tolerance_share
        Gain in score below which a fit has converged: a number, and a share of the gain of all causes.
    plain_error, restart_error
        Assumed error of every line in a plain least-squares fit, as a share of the response: usually, and in a restart
        of a fit. The smaller this error, the weaker the influence of the prior.
    neglected
        Ratio of the errors in two recordings above which the fit neglects the recording with the larger error.
    below_noise
        If the ratio of residual power to measured noise power is below this, the measured noise contains signal.
    """

    thinned_lines: int = 4000
    iterations: int = 60
    restart_iterations: int = 20
    tolerance: float = 3.0
    tolerance_share: float = 5e-4
    plain_error: float = 0.01
    restart_error: float = 0.03
    neglected: float = 2.0
    below_noise: float = 0.7


FITTING = FitSettings()


@dataclass(frozen=True)
class ResidualSettings(
    Thresholds,
    shares=("repeats", "chance", "modal_error", "burst_chance", "burst_share", "not_modelled", "noise_chance"),
):
    """When a residual is not noise.

    Parameters
    ----------
    repeats
        Least correlation of the residual with itself one period of the forces later that counts; a small correlation
        may be due to small errors of the refitted modes.
    chance
        Quantile of the agreement between the residual and shifted predictions up to which agreement is due to chance.
    noise_errors
        Standard errors by which a residual must exceed measured noise.
    modal_error
        Error that even a complete modal model may have, as a share of the response.
    burst_chance, burst_power
        Probability that noise makes any burst in a response, and smallest power of a burst over the median block.
    burst_signal
        Power of the predicted response over its median block, above which the signal may cause the burst.
    burst_share
        Share of the residual power from which bursts are reported.
    change_errors
        Standard deviations of chance by which a gain or lag must change during a recording. A normal variable exceeds
        four once in 30 000.
    outside_modes
        A frequency is outside the modes if its ratio to the highest mode, or the lowest mode's ratio to it, is larger.
    not_modelled
        Share of the response's power outside the modes that the forces must explain and the model must not.
    noise_scatter
        Standard deviation of the logarithm of the noise power, relative to the signal, between recordings of one rig:
        an assumption of this project. A factor of 1.3 in amplitude, so that 3 between two recordings is an exception.
    noise_chance
        Probability that noise with this scatter exceeds a bound in any recording and response.
    """

    repeats: float = 0.25
    chance: float = 0.8
    noise_errors: float = 2.0
    modal_error: float = 0.01
    burst_chance: float = 1e-4
    burst_power: float = 4.0
    burst_signal: float = 2.0
    burst_share: float = 0.1
    change_errors: float = 4.0
    outside_modes: float = 1.3
    not_modelled: float = 0.25
    noise_scatter: float = 0.5
    noise_chance: float = 0.01


RESIDUAL = ResidualSettings()
