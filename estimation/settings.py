"""Thresholds, tolerances, limits and defaults of this package, each with its unit and meaning."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RecordingSettings:
    """Reading, judging and resampling of recordings, and their averaged spectra."""

    bytes_per_value: float = 100.0  # memory per value of a band recording in simulations and transforms of all of it
    bytes_per_tap_value: float = 140.0  # memory per value of a force in which taps are searched, measured at its peak

    flat_share: float = 0.8  # share of the Nyquist frequency that stays flat and free of aliases
    stopband: float = 90.0  # dB, attenuation of aliases by the low-pass filter
    worthwhile_ratio: float = 1.5  # sample rate over needed rate from which a filter costs less than it saves
    largest_denominator: int = 200  # of a resampling ratio: the new rate is within 0.5 % of the needed rate

    longest_unfiltered: int = 2_000_000  # samples up to which a recording is read unfiltered to see whether it rests
    quiet_force: float = 0.02  # share of its largest value up to which a force has not begun
    quiet_response: float = 0.02  # power before the first force over mean power up to which the structure is at rest
    quiet_samples: int = 16  # shortest quiet beginning: a motion that passes zero is quiet for a shorter time
    quiet_seconds: float = 0.02  # s, shortest quiet beginning
    blow_share: float = 0.1  # share of the samples with any force up to which the forces are blows of a hammer
    early_response: float = 0.05  # largest response before a blow, over the largest of all, of a structure at rest

    overload: float = 0.999  # share of full scale from which a sample counts as overloaded
    clipped_samples: int = 4  # equal samples in succession at the extreme of a channel
    repeated_rows: int = 8  # equal rows in succession: a buffer was handed out twice, or not filled
    flat_samples: int = 3  # equal samples at the extreme of a hammer force or of its response
    steep_edge: float = 2.5  # smallest steps by which a clipped extreme is left; a smooth maximum is left by one

    rounding_samples: int = 1024  # samples in which a step of rounding is looked for
    distinct_share: float = 0.1  # share of distinct values above which rounding is finer than the signal
    lattice: float = 0.05  # largest distance of a value from a multiple of the step, in steps

    shortest_segment: int = 8  # samples
    judged_segment: float = 8.0  # s, longest segment for judging inputs: longer ones leave too few averages
    nearly_dependent: float = 1e3  # condition number of the input spectra above which inputs are nearly dependent
    # Smallest over largest eigenvalue of the scaled input spectra down to which a line has an FRF (condition 10 000):
    # below it, noise of 1 % on the sensors decides a column of the FRF.
    independent: float = 1e-4


@dataclass(frozen=True)
class FrfSettings:
    """FRFs, their files, and geometries."""

    coherent: float = 0.5  # multiple coherence of the best response from which a line is known
    bridged_lines: int = 8  # gap that is bridged: a multisine drives every second or fourth line
    spare_equations: int = 8  # equations above the number of unknowns of a local polynomial
    same_axis: float = 1e-5  # relative difference of equal frequency axes: UFF headers have six digits
    coherence_rounding: float = 1e-6  # by which a coherence may lie outside 0 to 1: files have single precision
    impossible_lines: float = 0.05  # share of lines with another coherence that are left out; above it, refused
    largest: float = 1e100  # a larger value is damaged: its square overflows
    right_angle: float = 1e-3  # cosine between local axes that counts as a right angle: files have few digits


@dataclass(frozen=True)
class HammerSettings:
    """Detection, judgement and segments of hammer taps."""

    settle: float = 0.2  # s, shortest time between two taps
    tap: float = 0.2  # share of the largest force in the record from which a hit is a tap
    candidate: float = 0.05  # share of the largest force from which a hit is listed, as a tap or as too weak
    contact: float = 0.05  # share of a tap's peak above which hammer and structure are in contact
    second_hit: float = 0.1  # share of a tap's peak from which a second contact is a double hit
    noise_level: float = 12.0  # standard deviations of the noise; white noise stays below 6 in any record
    ringing_samples: int = 8  # samples for which a converter's filter may ring after a hard contact
    level_seconds: float = 1.0  # s, duration over which the median gives the resting level of a force
    weak: float = 0.2  # share of the median peak below which a tap is left out as weak
    busy: float = 0.2  # share of the largest force above which a force is busy

    longest_segment: float = 16.0  # s, longest segment that is chosen automatically: noise grows with length
    lost_taps: float = 0.2  # share of a test's taps that longer segments may cost
    enough_length: float = 0.6  # share of the longer segment from which a shorter segment without lost taps is taken
    shortest_segment: int = 64  # samples
    level_samples: int = 4  # least samples before a contact that give the resting level of a channel
    level_share: float = 0.25  # share of a segment before a tap over which the resting level is computed
    rise: float = 0.75  # largest share of a contact that lies before its peak
    filter_samples: int = 24  # samples for which a converter's filter rings before and after a hard contact
    echo: float = 0.02  # share of the peak that the force may reach after the force window, which cuts this force off
    echo_noise: float = 6.0  # standard deviations of the noise that an echo exceeds

    driven: float = 1e-4  # power of the force over its largest, down to which an FRF is given: 40 dB
    independent: float = 1e-4  # smallest over largest eigenvalue of the scaled force spectra of several inputs
    band: float = 1e-2  # power of the force over its largest, down to which a tap drives a line: 20 dB

    died_out: float = 0.003  # share of a response that may be cut off: the relative error of an FRF at its resonances
    windowed: float = 0.0003  # share of a response that an exponential window leaves at the segment's end
    strong: float = 1e-5  # power over the largest of a response from which a line is examined: 50 dB
    false_peak: float = 1e-6  # probability that noise alone makes a line exceed its neighbours
    chance_coherence: float = 1e-4  # probability that noise or hum reaches a coherence with the force
    sufficient_coherence: float = 0.9  # coherence above which a late signal responds to the taps in any case
    falling: float = 0.87  # power of the last half over the middle half below which a late signal decays
    excess: float = 4.0  # least power over that before the first tap (hum), and over neighbouring lines
    neighbours: int = 41  # lines with which a line is compared
    least_damping: float = 0.3  # least sigma T that is assumed, where noise hides the decay or there is hardly any
    hum_block: float = 0.2  # s: 10 and 12 periods of the mains, which a Hann window separates
    hum_blocks: int = 16  # that are in memory at once
    hum_reach: float = 0.002  # relative deviation of the mains that is searched: 0.1 Hz of 50
    hum_phase: float = 1e-5  # turns over the recording, to which the frequency of hum is computed
    hum_around: float = 2.0  # Hz on either side, in which neighbouring frequencies show the noise
    hum_harmonics: int = 12  # multiples of the mains that are examined: those of rectifiers with 12 pulses
    lowest_line: int = 4  # below it the window's main lobe holds the remaining level


@dataclass(frozen=True)
class PeriodSettings:
    """Periods of forces, noise between periods, and distortion."""

    alike: float = 0.99  # correlation of the forces with themselves a lag later from which they repeat
    candidate: float = 0.2  # correlation over the whole recording from which a lag is examined: realisations share it
    silent_power: float = 1e-3  # share of the mean power below which a force has no period
    lags: int = 12  # number of lags that are examined closely
    period_error: float = 0.1  # share by which the period from the phase may differ from the lag

    transient: float = 4.0  # power of a change to the next period over later changes, above which it is transient
    driven: float = 1e-3  # power of the forces in a band over the largest from which the band is excited
    band_lines: int = 16  # lines whose power is added up to find transients, which ring in few lines
    same_force: float = 0.99  # correlation of two realisations at the best lag from which they are the same
    far_below: float = 1e-3  # power of a line over the largest of all up to which it was not excited
    below: float = 1e-2  # power of a line over the largest of its neighbours up to which it was not excited
    neighbours: int = 10  # lines on either side with which a line is compared
    mains: tuple[float, float] = (50.0, 60.0)  # Hz; hum stays in step with many periods and imitates distortion
    significant: float = 1e-3  # p-value below which distortion is reported

    freedom: float = 8.0  # degrees of freedom per channel below which neighbouring lines are averaged
    drift: float = 0.5  # von Neumann's ratio below which periods drift: white noise has 1, a straight drift 0
    quiet: float = 0.05  # force over its root mean square in the recording below which a block is silent
    rung_out: float = 1.5  # power of a silent block over the median of the quieter half, above which it still rings
    silent_blocks: int = 4  # number of silent blocks that are needed


RECORDINGS = RecordingSettings()
FRFS = FrfSettings()
HAMMER = HammerSettings()
PERIODS = PeriodSettings()
