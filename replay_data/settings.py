"""Numbers that decide something in the simulated cells and robots, with their units and meanings."""

from dataclasses import dataclass

Range = tuple[float, float]


@dataclass(frozen=True)
class Settings:
    """Limits of the simulation and ranges of random values; assumed where no source is stated."""

    # milling and hammer cells
    longest_rehearsal: float = 5.0  # s: longest simulation without noise from which the noise level is computed
    steps_per_tooth: int = 8  # steps of the simulation per tooth pass, at least
    first_tap: float = 0.05  # s: time before the first tap
    tap_scatter: float = 0.15  # standard deviation of the tap amplitudes over their mean, as by hand
    tap_limits: Range = (0.3, 1.7)  # least and largest tap amplitude over the mean

    # anti-alias filter
    filter_half_width: int = 8  # half the length of the filter, in output samples
    passed_share: float = 0.8  # -6 dB frequency over the new Nyquist frequency
    kaiser_beta: float = 7.9  # shape of the window: stop band at -80 dB

    # settling of a cut
    settled: float = 1e-3  # deviation over the largest deviation at the start below which a cut has settled
    settling_steps_per_tooth: int = 128  # steps per tooth pass, at least
    settling_steps_per_period: float = 24.0  # steps per period of the highest mode, at least
    most_turns: int = 4000  # spindle turns after which the result is open
    most_steps: int = 4_000_000  # steps after which the result is open

    # robots drawn at random
    natural_frequencies: tuple[Range, ...] = ((10.0, 12.0), (15.0, 18.0), (22.0, 26.0))  # Hz: heavy articulated robots
    damping_ratios: Range = (0.02, 0.06)
    modal_masses: Range = (180.0, 320.0)  # kg, at the tip
    shape_skew: float = 0.2  # largest deviation of the mode shapes from an orthogonal triad, per component

    # recordings with a concealed effect
    recording_rate: float = 512.0  # Hz
    sweep_rpm: Range = (240.0, 1080.0)  # 8 to 36 tooth passes per second
    axial_depth: float = 1e-3  # m
    immersion_over_pi: Range = (0.38, 1.0)  # start and exit angle


SETTINGS = Settings()
