"""Numbers that decide something in the steps of the command line."""

import math
from dataclasses import dataclass

RPM = math.pi / 30  # one revolution per minute in rad/s
SPEED_EVENTS = "spindle_speed_rpm"  # event series, and key in any table of the set-up, that states the spindle speed


@dataclass(frozen=True)
class StepSettings:
    """Limits and defaults of the steps."""

    # Channels before a recording (acquire --check)
    least_margin_db: float = 6.0  # dB; a peak nearer to full scale than this may clip in the cut
    shorted: float = 3e-6  # share of full scale; a 24-bit input alone has 1e-6 to 1e-5, a working sensor has more
    open_offset: float = 0.5  # share of full scale; the supply drives an input without a sensor to the rail
    tap_crest: float = 12.0  # peak over standard deviation of a force from which it holds taps
    largest_delay: float = 50e-6  # s; shifts phases by 2 degrees at 100 Hz

    # Live page
    preview_pause: float = 0.2  # s between two previews of a source that ends

    # Fit of recordings
    subspace_order: int = 60  # highest order of the state space without --max-order
    margin_above_band: float = 1.6  # records keep frequencies up to this multiple of the band's upper end

    # Another tool
    clamped_reach: float = 20.0  # multiple of the band's upper end up to which a mode of the clamped tool is named

    # Lobes
    n_speeds: int = 100  # spindle speeds without --speeds
    learned_speeds: int = 40  # the same for learn, which solves the limits of 78 structures
    small_mode: float = 0.1  # modes below this share of the largest resonant term do not set the range of speeds

    unmeasured_wall: float = (
        0.1  # share of the motion across a wall outside the measured band, above which it is doubted
    )

    # Cuts that are classified
    bytes_per_sample: float = 160.0  # peak memory of a classification per sample and channel
    passings_shown: int = 6  # tooth passings that a stored spectrum shows at least
    margin_above_line: float = 1.5  # a stored spectrum reaches this multiple of the highest line that was named

    # Tables and files
    rows_shown: int = 40  # rows of a table on the terminal; the provenance of the file has all
    largest_structure: float = 100.0  # m; larger geometries are probably in mm


STEPS = StepSettings()


@dataclass(frozen=True)
class LobesSettings:
    """Number of modes and of samples in stability lobes of a robot."""

    periods_in_tooth_period: float = 20.0  # of the highest mode in the longest tooth period: below, all modes are kept
    mode_counts: tuple[int, ...] = (8, 11, 15, 20, 27, 36, 48)  # numbers of modes that are tried
    negligible_change: float = 5e-3  # relative change of the limits; a cut would not show it
    samples: int = 79  # of learned models: 76 of 80 intervals between ordered limits are inside the 2nd and 78th, 95 %
    speeds_in_error: int = 5  # inside the error of a spindle speed, at which draws of a path's places are solved


@dataclass(frozen=True)
class PathSettings:
    """Search of the postures along a path."""

    workers: int = 2  # processes that evaluate postures
    postures_per_task: int = 24  # at most; postures of one point stay together, since they may share a solution
    same_model: float = 1e-7  # relative difference of poles and residues below which two postures have one limit

    # Number of modes
    mode_counts: tuple[int, ...] = (8, 11, 15, 20, 27)  # the last is the reference, a kilohertz on a heavy robot
    periods_in_tooth_period: float = 15.0  # of the highest mode of the reference: the cost grows with the third power
    negligible_change: float = 5e-3  # relative change of the limits; a cut would not show it
    largest_screening_change: float = 0.05  # of a limit by missing modes, up to which screening goes on without them
    mode_choices: int = 3  # the modes are chosen again if the chosen postures need more than the sampled ones

    # Search
    anchors: int = 17  # points at which every posture is evaluated; values between them are interpolated
    same_branch: float = 0.8  # rad; largest joint difference to the posture at an anchor
    certified_every: int = 4  # points between those that are certified during the search
    searches: int = 4  # searches with certified values in place of interpolated ones
    largest_miss: float = 0.02  # share of the promised depth by which certified values may be lower
    turning_cost: float = 1e-3  # of one squared radian, as a share: equal postures are not turned
    front_levels: int = 9  # depths of the front, with those of the two single optima
    bottleneck_slack: float = 0.02  # share of the worst value that may be lost for less motion
    motion_weight: float = 0.1  # of squared joint steps against the cost of a posture
    smoothing_loss: float = 0.01  # share of the objective that may be lost for a smooth sequence


@dataclass(frozen=True)
class RobotSettings:
    """Limits and defaults of the other steps on robots."""

    band_factors: tuple[float, float] = (0.4, 1.3)  # of the lowest and highest mode: band of updates and diagnoses
    normal_95: float = 1.96  # standard errors in half a 95 % interval
    runout_directions: int = 12  # of the runout relative to the cutting edges; the worst is taken
    window_taps: int = 9  # half lines that a Hann window averages: beyond, its weight is below 0.1 %

    # Learned postures
    candidates: int = 40  # postures to choose the next measurement from
    targets: int = 20  # postures whose predictions are to improve
    joint_margin: float = 0.1  # share of the measured joint range that is added at both ends
    least_in_band: float = 0.6  # share of a posture's frequencies in their bands; below, the posture may be wrong

    # Identified stiffnesses
    large_error: float = 2.0  # standard errors of the measurement; a larger error held out gives a warning
    largest_residual: float = 1 / 3  # share of the deflections; a larger residual is refused


LOBES = LobesSettings()
PATH = PathSettings()
ROBOT_STEPS = RobotSettings()
