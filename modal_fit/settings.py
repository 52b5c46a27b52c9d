"""Numbers that decide something in the modal fits, with their units and meanings."""

from dataclasses import dataclass

from millfrf.core import Band

FixedPoles = tuple[tuple[float, ...], tuple[float, ...]]  # multiples of the lower and of the upper edge of the band


@dataclass(frozen=True)
class Effort:
    """Limits at which a refinement ends: a number of steps, or a relative gain of the cost per step."""

    steps: int
    tolerance: float


@dataclass(frozen=True)
class Settings:
    """Thresholds, tolerances and limits. They were chosen on the FRFs of `docs/accuracy.md` and decision 16."""

    # poles over model order
    regular_diagonal: float = 1e-6  # smallest over largest diagonal entry of a Cholesky factor that is regular
    stable_frequency: float = 0.01  # relative change from order to order up to which a pole is stable in frequency
    stable_damping: float = 0.10  # relative change up to which it is stable in damping
    stable_vector: float = 0.95  # modal assurance from order to order above which a vector is stable
    track_reach: float = 0.03  # relative distance in the complex plane within which a pole continues a mode
    track_memory: int = 5  # latest poles of a mode whose median the next pole is compared with
    order_share_of_mode: float = 0.4  # share of all orders in which a mode must be found
    largest_damping: float = 0.5  # damping ratio above which a pole is a trend, no vibration
    damping_scatter: float = 0.5  # relative scatter of the damping between orders above which a group is no mode
    most_poles: int = 120  # largest number of poles of the highest order chosen by default

    # candidates of an FRF fit
    order_ranges: tuple[float, ...] = (0.4, 0.6, 0.8, 1.0)  # upper ends of the ranges, over the highest order
    order_share_of_candidate: float = 0.2  # share of the orders of a range in which a candidate must be found
    same_candidate: float = 0.15  # distance over damping ratio below which two poles are one candidate
    steady_candidate: float = 0.5  # share of the orders from which a candidate counts as steady
    unstable_candidate: float = 0.4  # share of the orders below which a candidate is first checked for a residual
    same_participation: float = 0.9  # modal assurance of participations from which overlapping candidates are one mode
    hidden_correlation: float = 0.1  # correlation of neighbouring residuals from which a mode may hide another
    hidden_order_share: float = 0.3  # share of the orders that is assumed for a pole of the residual
    search_misfit: float = 1.5  # squared residual over noise above which the residual is searched
    rounding_share: float = 1e-12  # share of the FRF's power below which a residual is rounding
    selection_rounds: int = 4  # rounds of trials over the pending candidates
    residual_searches: int = 3  # searches for candidates in the residual

    # acceptance of a mode; widths are half bandwidths, damping ratio times frequency
    noise_misfit: float = 2.0  # squared residual over expected noise up to which it counts as noise
    white_correlation: float = 0.35  # correlation of neighbouring residuals up to which they count as noise
    resolved_lines: float = 3.0  # lines in a width from which errors of a model are smooth over the lines
    error_reach: float = 4.0  # sums of widths within which errors of two modes overlap
    near_mode: float = 3.0  # sums of widths within which two modes may be one
    overlapping: float = 1.0  # sums of widths within which two modes overlap
    needed_share: float = 0.2  # least residual without a mode over the modes' size, where it is more than noise
    needed_share_of_few_orders: float = 0.6  # least residual without a mode that few orders have
    least_gain: float = 1.5  # factor by which the squared residual must fall where it stays more than noise
    certain_gain: float = 300.0  # factor from which errors of the other modes cannot be the reason
    alike_assurance: float = 0.6  # product of both vectors' assurances from which a mode without a peak is a copy
    stated_peaks: int = 3  # stable columns at peaks that a warning names; the list of dropped poles has all
    peak_smoothing: float = 0.25  # half bandwidths over which the response is averaged before a peak is looked for
    misfit_without_mode: float = 2.0  # factor of the whole band's misfit above which an isolated mode stays
    largest_mode_damping: float = 0.3  # damping ratio above which a fitted pole is a trend of the response, no mode
    largest_frequency_error: float = 0.2  # standard error over frequency above which a fitted pole is no mode
    rounding_power: float = 1e-14  # share of the FRF's power below which a misfit is rounding

    # lines of an FRF fit
    fewest_lines: int = 8  # lines in the band that a fit needs at least
    noise_outlier: float = 3.4011973816621555  # ln 30: an entry's noise this far below row and column is raised
    noise_block: int = 100  # lines over which noise counts as white where only neighbouring lines show it
    least_noise: float = 1e-3  # least noise variance over the median of the lines; smaller ones are raised
    lines_for_three_poles: int = 60  # lines from which three fixed poles represent the modes outside, else one
    neighbourhood_width: float = 6.0  # widths to each side of a pole that make up its neighbourhood
    fewest_around: int = 24  # lines of a neighbourhood at least
    lines_per_term: int = 6  # lines of a neighbourhood at least, per out-of-band term
    outer_mode_reach: float = 1.5  # factor to an edge of the band within which an outer mode is fitted as a mode

    # out-of-band terms
    fixed_pole_damping: float = 0.05  # damping ratio of the fixed poles
    poles_outside_band: tuple[FixedPoles, ...] = (((), ()), ((), (2.0,)), ((), (1.3, 3.0)), ((0.7,), (1.3, 3.0)))
    fewer_outer_poles: tuple[FixedPoles, ...] = (((), (2.0,)), ((), (1.3, 3.0)), ((0.7,), (2.0,)))  # fewest first
    other_outer_poles: tuple[FixedPoles, ...] = (((0.5,), (1.6, 4.0)), ((0.85,), (1.15, 2.0)))  # for the error bars
    more_or_fewer_outer_poles: tuple[FixedPoles, ...] = (((0.7,), (1.3, 3.0)), ((), (2.0,)))  # where few were used
    terms_misfit: float = 1.1  # misfit over that with all terms; by leakage a term gains up to 8 %

    # refinements
    first_step_damping: float = 1e-3  # of the Levenberg-Marquardt matrix, relative to its diagonal
    largest_step_damping: float = 1e8  # damping above which no step lowers the cost
    final_effort: Effort = Effort(40, 1e-7)
    selection_effort: Effort = Effort(8, 1e-3)
    trial_effort: Effort = Effort(12, 1e-3)
    held_out_effort: Effort = Effort(10, 1e-4)
    terms_effort: Effort = Effort(8, 1e-4)
    error_effort: Effort = Effort(8, 1e-5)

    # error bars and warnings
    edge_step: float = 0.05  # share of the band by which an edge moves for the error bars
    most_parameters: int = 700  # parameters with a covariance matrix: the file of more would exceed 10 MB
    poor_chi_square: float = 2.0  # reduced chi-square above which a fit has a warning
    poor_entry: float = 0.3  # relative error of an entry above which a fit has a warning

    # delay of a transfer
    longest_delay: float = 4.0  # periods of the band's upper edge
    delay_grid: int = 160  # delays that are tried at first
    delay_rounds: int = 4  # alternations of delay and poles

    # fit of recordings
    block_rows: int = 40  # samples of past and future in the correlations, by default
    spare_block_rows: float = 1.5  # rows of the observability matrix over the states of the highest order
    transient_terms: int = 2  # terms of the polynomial for transients from outside the band
    noise_rounds: int = 20  # largest number of alternations of noise variances and unknowns
    steps_of_round: int = 4  # Gauss-Newton steps between two estimates of the noise
    largest_noise_share: float = 0.99  # of the information on a combination of unknowns; above it nothing is known
    likelihood_steps: int = 25  # Gauss-Newton steps with fixed noise
    likelihood_gain: float = 0.02  # gain of the cost that ends these steps; 1 is a change by one standard error
    scoring_steps: int = 40  # steps of the noise variances with fixed unknowns

    # comparisons
    same_mode_distance: float = 0.1  # relative distance of poles beyond which two modes are not the same
    significant_change: float = 3.0  # standard errors above which a mode has moved
    moving_p_value: float = 1e-3  # p-value, over the number of modes, below which a natural frequency has moved
    modes_tested_together: int = 6  # most modes of the part of a band in which their motion is tested
    responses_tested: int = 3  # most responses in which it is tested
    significance: float = 0.01  # p-value below which a change with the level is significant
    crossing_assurance: float = 0.8  # assurance of a curve's vectors across a peak below which two curves cross there
    matched_frequency: float = 0.25  # distance in ln frequency up to which a hammer mode matches an in-process mode
    matched_assurance: float = 0.8  # assurance at the sensor below which two modes are not the same
    usual_shift: float = 0.2  # change of ln frequency that counts as much as an assurance of 0; robots: 0.03 to 0.15
    matched_factor: tuple[float, float] = (0.5, 2.0)  # in-process over hammer residue; units and signs lie outside
    gain_rounds: int = 30  # alternations of the gains of responses and of forces
    opposite_motion: float = 0.5  # correlation of tip and sensor beyond which they move against each other
    uncertain_ratio: float = 0.3  # relative error of the sensor's motion above which the ratio to it is not used

    # tapped modes outside the band of the cut
    span_of_matches: Band = (0.6, 1.5)  # ends of the hammer fit at least, over lowest and highest in-process mode
    tapped_above: float = 10.0  # upper end over that of the cut: teeth pass at up to 450 Hz on modes from 11 to 48 Hz
    band_reach: float = 1.25  # factor by which a band must be wider than that of the cut for tapped modes
    noticed_peak: float = 0.05  # share of the largest peak from which a mode that only one test shows is named
    seam_jump: float = 0.05  # share of the receptance from which a jump between two bands is named
    slope_step: float = 1e-4  # step of a logarithm for numerical slopes

    # picked poles
    offered_group_distance: float = 0.003  # relative distance within which a pole of an order belongs to a group
    same_picked_pole: float = 0.05  # distance over damping ratio below which two picked poles are one
    moved_pole: float = 2.0  # half-power bands by which a refined pole moves away from the picked one

    # tools as beams
    longest_transfer: float = 3.0  # largest wave number times length of a beam whose transfer matrix is inverted
    transfer_terms: int = 22  # terms of the power series of a transfer matrix: 9^22 / 44! is 4e-34
    base_steps: int = 30  # steps of the least squares for the base on each line
    first_base_damping: float = 1e-6  # damping of their first step, over squared columns of length 1
    base_tolerance: float = 1e-6  # decrease of chi-square in a step, on every line, at which they end
    least_singular: float = 1e-12  # least singular value of unit columns: rounding
    lines_for_numbers: int = 300  # lines to which contact and uncertain numbers of blanks are fitted at most
    settled_numbers: float = 1e-4  # step of the numbers of a base, in squared standard errors, at which they end
    number_step: float = 0.01  # step of a number for numerical slopes, in its unit
    small_change: float = 0.02  # share of an FRF by which an error common to all lines changes it in a new fit
    small_shift: float = 0.1  # largest shift of a pole in such a fit, over its decay rate: the fit is linear in it
    clamped_lines: int = 2000  # lines at which the first natural frequency of a clamped tool is looked for


SETTINGS = Settings()
