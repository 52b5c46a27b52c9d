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
    subspace_order: int = 30  # highest order of the state space without --max-order
    margin_above_band: float = 1.6  # records keep frequencies up to this multiple of the band's upper end

    # Lobes
    n_speeds: int = 100  # spindle speeds without --speeds
    small_mode: float = 0.1  # modes below this share of the largest resonant term do not set the range of speeds

    # Cuts that are classified
    bytes_per_sample: float = 110.0  # peak memory of a classification per sample and channel
    passings_shown: int = 6  # tooth passings that a stored spectrum shows at least
    margin_above_line: float = 1.5  # a stored spectrum reaches this multiple of the highest line that was named

    # Tables and files
    rows_shown: int = 40  # rows of a table on the terminal; the provenance of the file has all
    largest_structure: float = 100.0  # m; larger geometries are probably in mm


STEPS = StepSettings()
