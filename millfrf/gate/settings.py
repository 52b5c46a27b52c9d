"""Thresholds of the gate: the record :class:`GateSettings` and its only instance, ``GATE``."""

from dataclasses import dataclass


@dataclass(frozen=True)
class GateSettings:
    """Thresholds of all checks; a threshold without a stated source was chosen in this project."""

    # Sample rates, compared by the gain (response over force) of two tests on a logarithmic frequency axis.
    log_step: float = 0.01  # step of ln(f); a resonance of 1 % damping is two steps wide
    gain_driven: float = 1e-3  # share of the largest force power from which a line has a gain
    gain_same: float = 0.5  # spread of two gains up to which their shapes are equal; one set-up gives 0.07 to 0.4
    gain_different: float = 0.75  # spread from which the shapes differ; a rate wrong by a factor 2 gives at least 0.87
    rate_factor_min: float = 1.2  # smallest factor by which a rate is tested as wrong
    rate_factor_max: float = 12.0  # largest factor by which a rate is tested as wrong
    # Taps along different axes (cosine 0.0) show different modes; cuts of different immersions have 0.18 and more.
    force_direction_cosine: float = 0.1  # cosine of the channels' force power shares from which two tests are compared
    gain_steps_min: int = 20  # frequency steps that both gains must share

    # Cutting data
    radians_max: float = 3.2  # degrees; an engagement that ends below this was probably given in radians
    tooth_distance_min: float = 2e-4  # m along the circumference; no cutter has teeth closer together
    rpm_max: float = 500_000.0  # fastest milling spindles (air bearings, tools below 1 mm)
    rpm_min: float = 1.0  # below it no spindle turns evenly
    cutting_speed_max: float = 170.0  # m/s, about 10 000 m/min: the fastest milling of aluminium on record
    depth_max: float = 0.3  # m; no cutting edge is longer
    speeds_max: int = 100_000  # spindle speeds of one table of lobes
    slow_passing: float = 0.1  # tooth passing over the lowest mode below which the speeds have the wrong unit
    speed_tolerance: float = 0.02  # relative difference between a typed and a stated spindle speed

    # Plans of sweeps
    sweep_max: float = 8 * 3600.0  # s; a day's work, longer sweeps are refused
    sweep_long: float = 1800.0  # s; half an hour, longer sweeps give a warning
    accelerometer_noise_max: float = 1.0  # m/s^2/sqrt(Hz); an accelerometer is 10 to 10 000 times quieter

    # FRFs
    coherent: float = 0.5  # coherence of a usable line; `estimate` states the band of such lines
    coherent_energy_min: float = 0.5  # share of a response's energy on such lines below which there is a warning
    rising_phase_max: float = 0.5  # share of weighted phase steps; measured FRFs: below 0.02, conjugates: above 0.98
    returned_wrong_sign: float = 0.9  # share of the power that one axis returns, above which its sign is wrong
    returned_max: float = 0.15  # share of a node's power; measured tips: below 0.05, swapped axes: 0.3
    fit_outside_max: float = 0.1  # share of a fit's band that may lie outside the band of its FRF
    input_driven: float = 1e-4  # share of an input's largest power from which it drives a line
    independent_lines_min: float = 0.5  # share of the driven lines; below it a fit has no data in most of the band
    line_error_max: float = 0.3  # standard error of the whole matrix on a line, over its size
    noisy_lines_max: float = 0.02  # share of lines above line_error_max without a warning

    # Passivity, magnitude and reciprocity
    passivity_coherent: float = 0.8  # multiple coherence of every response from which a line is checked
    passivity_lines_min: int = 8  # lines that a check of passivity needs
    flexibility_max: float = 1e-3  # m/N at the resonance (1 N/mm); robots and slender tools reach 1e-4 at most
    flexibility_min: float = 1e-11  # m/N at the resonance (100 000 N/um), stiffer than any machine tool
    reciprocity_difference: float = 0.3  # rms difference of H_pq and H_qp over the size of their drive points
    reciprocity_factor: float = 1.0  # difference over the size of the entries, if these are equal but for a factor
    reciprocity_correlation: float = 0.8  # correlation, or MAC of left and right vectors, of reciprocal entries
    reciprocity_noise: float = 3.0  # standard errors that a difference must exceed

    # Milling spindles weigh 5 to 60 kg, wrists of robots for 90 to 500 kg of payload 100 to 300 kg; in g they seem
    # 9.8 times heavier.
    tip_mass_max: float = 300.0  # kg, of the lightest direction of the tip

    # Models and fits
    chi_square_max: float = 2.0  # reduced; above it the error bars are too small, below the inverse noise is overstated
    misfit_max: float = 0.3  # rms misfit over the rms of an FRF entry, above which the entry is hardly known
    model_lines: int = 400  # lines at which a model is checked
    delay_angle: float = 0.05  # rad at the highest line; a late response shifts limits by about this share

    # Signals
    sample_rate_min: float = 20.0  # Hz; no vibration of a machine is recorded more slowly
    overload: float = 0.999  # share of full scale from which a sample is overloaded
    two_levels: float = 0.5  # share of samples at both extremes above which a channel is a switch and not clipped
    constant_samples: int = 256  # samples of one value in a row that a live channel may have
    constant_share: float = 0.05  # share of the record of such a run
    copied: float = 1e-12  # 1 - correlation below which two channels differ by a factor only; two sensors have more
    clip_visits: int = 3  # runs at the extreme; a signal that rests at one end is not clipped
    clip_samples: int = 8  # samples at the extreme, in all runs
    clip_ratio: float = 5.0  # samples at the extreme over samples at the next value: coarse sine 2.4, noise 1
    clip_zero: float = 1e-3  # share of the peak below which an extreme is zero: a tooth out of cut gives exactly 0
    held_rows: int = 8  # equal rows in a row, in every channel, that noise does not produce
    repeated_rows: int = 16  # rows in a row that equal earlier rows at one distance, in every channel
    periodic_share: float = 0.2  # share of repeated rows above which a record is a noise-free periodic simulation

    rounding_max: float = 0.1  # rounding noise over the deviation: its square, 1 %, is the bias of an H1
    hum_share: float = 0.1  # hum over the deviation of its channel: 1 % of the power, as much as noise usually has
    hum: tuple[float, ...] = (50.0, 60.0)  # Hz: mains of the world
    hum_harmonics: int = 3  # multiples of the mains that are examined
    hum_tolerance: float = 0.002  # relative deviation of a mains frequency
    hum_steady: float = 2.0  # amplitude of hum in one half of a recording over the other; a mains keeps it within 10 %
    hum_samples: int = 262144  # most samples of the spectrum in which hum is looked for
    hum_neighbours: int = 24  # lines on which the spectrum around the mains is known

    # Hammer taps in recordings
    tap_peak: float = 12.0  # peak over standard deviation of a force above which it shows taps; a cut has less than 6
    tap_peak_possible: float = 5.0  # from here a force is examined: one tap in a short record has little more
    tap_over_median: float = 12.0  # peak over the scaled median magnitude of the force; a cut has below 5
    tap_record_max: float = 900.0  # s; a longer recording is no hammer test
    tap_contact_max: float = 0.1  # share of the time in contact; teeth of a light cut have about as much
    taps_per_segment: float = 10.0  # taps from which the force is random, as segments and windows assume
    tap_early: float = 0.25  # share of a segment in which a tap must lie if the segment is to contain its response

    # Hammer tests
    cut_off_max: float = 0.02  # share of the response at the segment's end above which it is cut off
    ringing_max: float = 0.01  # share of the response to the previous tap; the FRF has a relative error of this size
    disagreement_max: float = 0.2  # energy of the difference between an entry from one test and from all tests
    tap_coherence_min: float = 0.8  # median coherence of an entry in the band
    tap_busy_max: float = 0.1  # share of time with a force above a fifth of its largest; above it, no hammer
    hammer_max: float = 5e4  # N; the largest instrumented sledge hammers measure up to 22 kN (PCB 086D50)
    tap_narrow: float = 0.5  # band of a point over the widest band of all points, below which it is narrow

    # Files compared with each other
    frfs_equal: float = 1e-9  # relative difference of one FRF given twice; two measurements differ by their noise
    scale_correlation: float = 0.8  # correlation from which predicted and measured differ by a factor only
    scale_tolerance: float = 0.15  # relative difference between this factor and the factor of a unit

    # Recordings compared with each other and with their forces
    p_value: float = 1e-3  # of a single comparison: below it, two measurements of one quantity disagree
    blocks: int = 6  # blocks of a recording; their scatter gives the error bars
    block_seconds: float = 6.0  # duration of a block: some ten periods of the lowest modes of robots
    block_samples: int = 65536  # most samples of a block, so that 24 channels stay below 100 MB
    block_rows_min: int = 160  # samples of a recording's block from which its forces have a spectrum
    onset_past: int = 16  # past samples of the response in the regression: eight modes
    onset_lags: int = 4  # lags of the force beyond the searched delays
    over_rounding: float = 1e3  # residual over the rounding of its products, from which these are used
    coarse_step: int = 4  # samples of the first search for the delay
    agreement_lags: int = 8  # lags of the forces in the common regression of several recordings
    driven_share: float = 0.99  # share of the power of the forces in the lines at which recordings are compared
    # Share by which a correction lowers the incoherent power, at least: a choice. In 60 random cells without mistakes
    # the best correction lowered it by up to 13 %, two accelerations exchanged in one test by 23 %.
    incoherence_fall: float = 0.2
    compared_responses: int = 6  # most responses in this regression
    corrections: int = 3  # most corrections that are named
    # Wrong sizes that are tested, from half to twice in equal ratios: the best shows if it is too small or large
    gain_steps: tuple[float, ...] = (0.5, 0.59, 0.71, 0.84, 1.19, 1.41, 1.68, 2.0)
    comb_width: float = 0.02  # relative half width of the lines of a comb, at least: jitter of the spindle
    comb_harmonics: int = 4  # harmonics of the tooth passing that are looked for
    unit_decades: float = 1.0  # decades between mean force and stated cut: kN for N is 3; a wrong material, below 1
    longest_delay: float = 0.7  # s, searched in both directions


GATE = GateSettings()
