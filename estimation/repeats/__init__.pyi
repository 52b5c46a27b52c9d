from .cut_periods import Realisation, SteadyPeriods, between_samples, same_forces, steady_periods
from .distortion_lines import Distortion, LineClass, distortion
from .level_comparison import Homogeneity, homogeneity
from .line_classes import excited_lines, silent_classes
from .linear_part import LinearApproximation, linear_approximation
from .noise_between_periods import covariance_of_periods, noise_of_periods, noise_of_repeats
from .noise_of_recordings import measured_noise
from .noise_type import MeasuredNoise
from .noise_without_repeats import noise_bound, noise_in_silence
from .period_search import RepeatedForce, Stretch, find_repeats, repeat_of

__all__ = [
    "Distortion",
    "Homogeneity",
    "LineClass",
    "LinearApproximation",
    "MeasuredNoise",
    "Realisation",
    "RepeatedForce",
    "SteadyPeriods",
    "Stretch",
    "between_samples",
    "covariance_of_periods",
    "distortion",
    "excited_lines",
    "find_repeats",
    "homogeneity",
    "linear_approximation",
    "measured_noise",
    "noise_bound",
    "noise_in_silence",
    "noise_of_periods",
    "noise_of_repeats",
    "repeat_of",
    "same_forces",
    "silent_classes",
    "steady_periods",
]
