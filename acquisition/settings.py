"""Numbers of this room that decide something: thresholds, tolerances, limits and default times."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Thresholds and limits of the acquisition; each comment states unit, meaning and reason."""

    # Channels and sessions
    longest_input_delay: float = 1.0  # s; a longer delay of an input is a mistake in its unit
    sample_rate_over_band: float = 2.56  # least sample rate over the band's upper end: room for the anti-alias filter
    largest_session_bytes: int = 1_000_000  # a larger file is no session file

    # Fit of a device's clock against the host's clock
    expected_drift: float = 100e-6  # prior standard deviation of a clock's relative error
    host_time_error: float = 1e-5  # s; error of the time of a least late pair
    interpolation_half_width: int = 31  # rows on each side of the windowed sinc that compensates a delay
    interpolation_beta: float = 8.0  # parameter of the Kaiser window of this sinc
    whole_row_tolerance: float = 1e-6  # rows; a delay this close to a whole number of rows is not interpolated

    # Check of a stream's sample rate and of missing time
    fewest_clock_pairs: int = 8  # fewer pairs determine nothing
    fewest_clock_slopes: int = 15  # from fewer slopes their spread does not determine the error of the rate
    largest_rate_error: float = 1e-3  # relative; clocks are off by 1e-4, a host that follows a time server by 5e-4
    smallest_gap: float = 0.02  # s; shorter gaps may be delays of the host
    gap_over_scatter: float = 6.0  # least gap over the usual change of lateness between neighbouring windows
    pairs_after_gap: int = 50  # pairs after a gap that are searched for its new level: a stalled host catches up

    # Stamps of clocks that step, and the wall clock
    lateness_tolerance: float = 0.03  # s; a smaller deviation from the usual lateness is no step
    smallest_stamp_step: float = 0.1  # s; smallest step that is recognized without a step of the wall clock
    shortest_hold: float = 1.0  # s for which values of unusual lateness are held at least
    longest_hold: float = 5.0  # s; a host is hardly busy for longer
    fewest_held: int = 3  # values that are needed to recognize a step
    lateness_period: float = 5.0  # s; the least lateness is kept for each such period
    lateness_periods: int = 3  # number of such periods that are kept, because clocks drift
    step_memory: float = 10.0  # s for which values from before a step may still arrive
    smallest_wall_clock_step: float = 0.02  # s; a time service slews by less between two readings

    # Devices
    messages_per_second: float = 5000.0  # of one device; a full CAN bus of 500 kbit/s gives 4500 of 8 bytes
    queued_events: int = 20_000  # of one device until the recorder takes them: 4 s of the largest rate
    queued_notes: int = 1000  # of one device until the recorder takes them
    held_values: int = 50_000  # values of one device that wait until it is clear whether its clock stepped
    decision_interval: float = 0.1  # s between two looks at these values
    longest_wait: float = 0.5  # s for which a replay in real time waits for a block, as Ctrl-C is seen between blocks
    switch_interval: float = 5e-4  # s after which a device's thread gives way to the recorder
    stop_time: float = 1.0  # s for which the end of a device's thread or process is awaited
    reconnection_interval: float = 1.0  # s between two attempts to reconnect a lost device
    modbus_attempts: int = 5  # unanswered requests in a row after which a drive counts as lost
    packets_for_cycle: int = 5  # packets from which the cycle of a robot's controller is determined
    sample_rate_tolerance: float = 1e-4  # relative deviation from the requested rate that is not reported
    excitation_tolerance: float = 0.2  # relative; modules report 2.1 mA for a nominal 2 mA
    teds_tolerance: float = 0.05  # relative; a larger deviation of the TEDS suggests another sensor

    # Files
    copies_in_memory: float = 2.5  # memory of a conversion over the size of the arrays of a file
    mat_bytes_per_value: float = 16.0  # largest memory that is needed while a MAT file is written, per stored value
    largest_unpacked_bytes: int = 2_000_000_000  # of a packed text: a small hostile file may unpack to any size
    largest_time_deviation: float = 0.01  # relative deviation of a time step from the mean step that passes as even
    coarse_times: float = 4.0  # steps over the resolution of the times, below which a single step says nothing
    largest_gaps: float = 100.0  # rows with gaps over rows without, above which a file would hold nothing but gaps
    largest_shift: float = 1e-3  # steps by which two channels may part and still count as sampled together
    recording_spare_bytes: int = 16_000_000  # reserved while recording, so that a full disk does not cost the file
    copy_spare_bytes: int = 1_000_000  # reserved while a recovered copy is written
    reading_time: float = 60.0  # s within which a child process must read a small file
    reading_bytes_per_second: float = 2e6  # slowest reading of a large file by a child process


SETTINGS = Settings()
