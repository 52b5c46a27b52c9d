"""Numbers that decide in the results of a campaign."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ResultSettings:
    """Thresholds, levels and scales of the identification of modes and of the tests of drifts and outliers."""

    # identification of modes
    unpaired_cost: float = 16.0  # squared distance above which two modes stay unpaired: four scales
    least_margin: float = 4.0  # increase of the squared distance below which a pair is uncertain: two scales
    least_mac: float = 0.3  # MAC below which a pair may be two modes with equal frequencies
    shape_scale: float = 0.3  # sqrt(1 - MAC) that counts as much as one scale of frequency
    set_frequency_scale: float = 0.03  # of log frequency in one posture: drift and scatter are a few per cent
    pose_frequency_scale: float = 0.03  # of log frequency between poses, at equal postures
    posture_frequency_scale: float = 0.1  # added to it per rad or m of distance between postures, up to 1
    unknown_frequency_scale: float = 0.1  # of log frequency between poses with unknown postures
    neighbours: int = 3  # nearest poses against which identities are checked
    rounds: int = 3  # iterations of pairing with the means of tracks

    # regressions
    most_groups: int = 6  # most values of a text label that form groups; a text with more is a remark
    misfit_quantile: float = 0.9  # at which the misfit of a series is truncated, against series that drift or jump
    sign_test_series: int = 8  # fewest series for a sign test of error bars; fewer are tested by their sum
    least_variance: float = 1e-16  # floor of the variance of a logarithm: rounding
    own_scatter_freedom: int = 8  # fewest degrees of freedom for a separate scatter of one mode
    scatter_freedom: int = 4  # fewest degrees of freedom of trend residuals for an estimate of scatter
    scatter_poses: int = 4  # else: fewest poses of a mode for an estimate from differences of slopes
    least_variation: float = 1e-3  # least share of the variance of a label that constant and groups do not explain
    pooled_poses: int = 3  # fewest poses of a pooled trend

    # drifts
    false_discovery_rate: float = 0.025  # half of the promised 5 %: scatter that differs between poses raises it
    suspect_p_value: float = 0.0027  # of a single trend that deserves another measurement: three standard errors
    equal_misfit: float = 4.0  # difference of chi-square of labels that explain equally well: two standard errors
    confounded_correlation: float = 0.5  # of two labels in a pose from which they may be confounded
    own_drift_level: float = 0.05  # family-wise rate of poses falsely found to drift differently from other poses
    single_set_share: float = 0.3  # a trend depends on one set if its slope without the set is below this share
    single_set_errors: float = 1.5  # or below so many standard errors
    power: float = 0.8  # of the test at the smallest detectable change

    # outliers and contradictory poses
    largest_leverage: float = 0.999  # leverage from which a value determines its fitted value and cannot be tested
    rival_share: float = 0.8  # of the largest deviation from which another set may be the outlier instead
    posture_false_discovery_rate: float = 0.01  # lower than for drifts, because the bands are approximate


SETTINGS = ResultSettings()
