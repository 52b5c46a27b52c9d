"""Numbers that decide results of the stability analysis, and the verdict on a recorded cut."""

from dataclasses import dataclass


@dataclass(frozen=True)
class StabilitySettings:
    """Thresholds and limits of the stability analysis."""

    # lines of a measured receptance that lobes can use (`known_lines`)
    noise_over_largest: float = 0.1
    """Noise of a line over the largest receptance above which the line is left out: a limit is inverse to the
    receptance, and its error is of this size."""
    noise_over_line: float = 1 / 3
    """Noise of a line over its own receptance above which the line carries no information."""
    unusable_share: float = 0.7
    """Share of the lines from the lowest on that must be unusable: a coarse resonance is rough at only a few lines."""
    largest_roughness: float = 1.5
    """Largest roughness that counts as noise, over its median in the band: a resonance between two lines is rough at a
    few lines, noise of a sensor at all lines."""
    least_lines: int = 8
    """Least number of lines from which lobes are drawn."""

    # cross terms that were not measured
    cross_terms: float = 0.05
    """Share of the direct terms that cross terms are taken to have: the transverse sensitivity of accelerometers is 3
    to 5 %, and a hit 3 degrees off gives 5 %."""
    compared_speeds: int = 8
    """Largest number of speeds at which limits with and without such cross terms are compared."""

    # modal models
    lost_share: float = 0.1
    """Share of the FRF at the resonances that may be left out without a warning; a limit changes by about as much."""

    # discretised tooth period
    most_nodes: int = 4000
    """Largest number of nodes in a tooth period; a structure that needs more is refused."""

    # multi-frequency solution
    most_harmonics: int = 60
    """Largest number of harmonics of the tooth passing on each side; a structure that needs more is refused."""
    converged: float = 2e-4
    """Largest share of a limit by which more harmonics may change it."""

    # certification
    beside_limit: float = 5e-4
    """Share of a limit by which the depths just below and just above it differ from it."""
    margins: tuple[float, ...] = (5e-4, 1e-2)
    """The same for cutters of any shape, tried in turn: where runout decides which teeth cut, edges jump between the
    nodes, and a finer discretisation moves the limit by up to 1 %."""
    ladder_ratio: float = 1.3
    """Ratio of neighbouring depths at which a limit is verified."""
    largest_ratio: float = 2.0
    """The same far below the limit, where multipliers alone find it, at half of the cost. Of 330 random cutters one
    limit moved, by 1.6 %: either ladder may miss its island of instability, which is 0.5 % thick."""
    thinnest_island: float = 0.01
    """Relative thickness of islands of instability that are found between these depths, where multipliers alone find
    the limit: they are searched wherever the largest multiplier may exceed 1."""
    dense_ratio: float = 1.05
    """Ratio of neighbouring depths at which a limit that was not confirmed is searched again."""

    # uncertainty of a limit
    closed_loop: float = 0.03
    """Largest distance of the loop gain at a limit from 1; beyond it the limit is not one of this structure and cut."""
    least_angle: float = 0.02
    """Sine of the angle between the loop's derivatives by depth and by frequency, below which a limit has no first
    order."""
    confidence: float = 0.95
    """Probability of the interval of a limit."""
    draws: int = 39
    """Draws for an interval: the smallest and the largest of 39 contain the next one with probability 38 / 40."""
    large_error: float = 0.15
    """Relative error of a limit from which draws are necessary."""
    frequency_jump: float = 0.02
    """Relative jump of the chatter frequency between two speeds from which draws are necessary."""
    around_jump: float = 0.01
    """Share of the speed around such a jump in which draws are necessary."""

    # certain limits
    certain: float = 0.07
    """Relative half width of the 95 % interval up to which a limit is certain: the accuracy that ``verified`` states.
    """
    certain_depths: tuple[float, ...] = (0.25, 0.5, 0.75, 1.0)
    """Shares of the largest depth at which draws are tried where there is no limit."""
    island_depths: tuple[float, ...] = tuple(0.93 / 1.1**k for k in range(15))
    """Shares of a limit at which islands of instability are sought, falling; islands thinner than a tenth are missed.
    """
    ranked_steps: tuple[float, ...] = (0.2, 0.3, 0.4, 0.52, 0.68, 0.82, 0.92, 1.0, 1.08, 1.2, 1.5, 2.0, 3.0, 5.0)
    """Shares of a limit at which draws are first tried where their smallest or largest limit is sought."""
    ranked_tolerance: float = 1e-3
    """Relative width of the interval in which the limit of a rank is found."""

    # simulation in time and surface error
    steps_per_period: float = 40.0
    """Steps of a simulation in a period of the highest mode."""
    steps_per_tooth: int = 120
    """Least steps of a simulation between two teeth."""
    most_instants: int = 20_000_000
    """Longest simulation."""
    unsteady: float = 0.02
    """Share of the motion that differs from turn to turn above which a simulated cut chatters."""
    lines_above: float = 1.5
    """Highest order of the spindle in a surface error, as a multiple of the structure's highest frequency."""
    most_steps: int = 65_536
    """Most steps of a turn in a surface error."""

    # recommended cut
    fine_speeds: int = 17
    """Speeds inside the drift at which the limits are computed again."""
    sampled_speeds: int = 5
    """Number of these speeds at which draws are solved: both ends, and the speeds with the lowest limits."""
    most_computed: int = 8
    """Largest number of speeds whose drift is computed."""
    most_sampled: int = 2
    """Largest number of speeds at which draws are solved."""

    # modes that were not measured
    least_damping: float = 0.01
    """Least damping ratio of an unmeasured mode, an assumption that every report states: measured modes of robots and
    tools in this project's tests have 2 to 10 %."""
    largest_flexibility: float = 1e-4
    """m/N at resonance; robots and slender tools reach no more. It bounds modes below the band near 0 Hz."""
    largest_shift: float = 0.05
    """Relative shift of a limit by unmeasured modes from which the limit does not rest on measured dynamics."""
    robust_angles: int = 24
    """Evenly spaced arguments of the multipliers at which the gain of unmeasured modes is computed, besides those of
    the cut's own multipliers."""
    small_gain: float = 0.3
    """Gain of unmeasured modes below which its peaks are not searched more finely."""
    robust_speeds: int = 15
    """Number of speeds at which the effect of unmeasured modes is computed before the search for a cut."""
    robust_lines: float = 40.0
    """Largest number of harmonics of the tooth passing on each side for that gain."""
    negligible_loop: float = 1e-3
    """Gain of the loop over some lines, relative to 1, up to which these lines are left out of that gain."""
    robust_shares: tuple[float, ...] = (1.0, 0.97, 0.9, 0.75, 0.5, 0.25, 0.1, 0.03)
    """Depths, as shares of the limit, at which that gain is computed until it is below 1; bisection follows."""
    robust_step: float = 0.04
    """Relative width of the interval at which the bisection for that depth ends."""

    # mode coupling
    equal_limits: float = 0.1
    """Relative difference up to which two limits count as equal."""
    coupled_modes: int = 10
    """Number of lowest modes whose coupling is judged."""


SETTINGS = StabilitySettings()


@dataclass(frozen=True)
class ChatterSettings:
    """Thresholds of the chatter verdict. Shares of the motion are ratios of root mean squares."""

    # recording and spindle
    least_revolutions: int = 40
    """Least number of spindle revolutions in a recording."""
    speed_error: float = 0.012
    """Largest relative error of the stated spindle speed that is searched."""
    speed_drift: float = 0.01
    """Largest relative change of speed over the recording that is followed."""
    first_harmonic: tuple[float, float] = (0.1, 0.3)
    """Least size of the first harmonic of the tooth passing over that of a further one: between orders, at an order."""
    line_error: float = 0.3
    """Error of a line's frequency, in lines of resolution."""
    comb_error: float = 0.001
    """Relative error of a line's frequency, in addition to half a line of resolution, as the speed varies."""
    overridden: float = 0.2
    """Logarithm of the spindle's speed over the stated one, up to which the comb's speed next to it is the spindle's:
    an override, or a slip. Numbers of teeth to a line differ by factors of two or more."""
    reported_speed_error: float = 0.002
    """Relative error of the stated speed above which a warning says so."""

    idle_ratio: float = 4.0
    """Size of the orders in the cut over that of the idle spindle, from which both are distinguished."""
    least_segments: int = 8
    """Least number of segments whose power shows whether a line is steady."""
    absent: float = 0.2
    """Size of a line out of the cut over its size in the cut, below which it comes from the cut."""
    highest_line: float = 0.46
    """Highest frequency of a line over the sample rate; above, the resampling attenuates by more than a quarter."""
    shortest_segment: int = 24
    """Least number of revolutions in a segment of the spectrum."""

    # lines of the spectrum
    line_p_value: float = 1e-4
    """Family-wise p-value below which a line is significant."""
    order_p_value: float = 1e-3
    """p-value above which the orders of the spindle are not significant."""
    order_power: float = 20.0
    """Power of an order over the noise floor from which it counts."""
    order_guard: float = 2.5
    """Distance from an order, in lines of resolution, within which only lines count that are not modulations of it."""
    one_sided: float = 10.0
    """Power of a line over the power at equal distance on the opposite side of an order, above which the line is not a
    modulation of the order."""
    of_the_order: float = 0.1
    """Power of such a line over the power of the order, above which no slow change of the order explains the line."""
    same_family: float = 1.2
    """Distance in lines of resolution within which two lines belong to one family."""
    most_lines: int = 80
    """Largest number of lines that are kept, strongest first."""

    # foreign tones
    mains: tuple[float, ...] = (50.0, 60.0)
    """Frequencies of the power supply, Hz."""
    mains_error: float = 0.004
    """Relative error of the mains frequency, in addition to the resolution of the spectrum."""
    mains_harmonics: int = 20
    """Highest harmonic of the mains that is recognised."""
    mains_width: float = 0.5
    """Hz; the largest uncertainty of a frequency with which a line is matched to the mains."""
    negligible: float = 0.03
    """Share of the motion below which lines are ignored: no limit cycle is as small."""
    foreign: float = 0.3
    """Share of the motion from which a line without side lines is not called foreign."""
    side_line: float = 0.02
    """Least size of a side line over the size of the strongest line."""
    chance_side_line: float = 0.15
    """Share of the motion below which one side line may be there by chance."""

    # lines that may be chatter
    sharp: float = 0.85
    """Sharpness above which a line is a periodic motion and not noise through a lightly damped mode."""
    sharp_sides: int = 2
    """Number of sharp side lines that a limit cycle has."""
    modulated: float = 0.2
    """Share of the motion from which lines with side lines are chatter even where they are not sharp."""
    limit_cycle: float = 0.05
    """Share of the motion from which sharp and steady lines are a limit cycle."""
    weak_chatter: float = 0.08
    """Share of the motion below which a steady line is not chatter where the chip is not known."""
    small_change: float = 0.05
    """Change of the chip over the thickest chip below which lines that are no limit cycle are noise."""
    steady: float = 0.45
    """Standard deviation of a line's power over its mean up to which the line is a limit cycle."""
    fluctuating: float = 0.6
    """The same ratio above which the line is noise through a mode."""
    as_large_as_forced: float = 0.4
    """Share of the motion from which lines with side lines are chatter where the chip is not known."""
    passing: float = 2.0
    """Standard deviation of a line's power over its mean above which it belongs to a part of the recording alone."""
    half_way: float = 0.5
    """Distance from half the tooth passing, in lines of resolution, within which chatter is period doubling."""
    dominant: float = 0.5
    """Share of the motion from which lines are chatter even where their size fluctuates."""
    near_mode: float = 0.2
    """Relative distance from a natural frequency within which a large line is chatter without side lines."""
    steadiness_of_change: tuple[tuple[float, float, float], ...] = ((0.1, 0.95, 0.4), (0.05, 0.6, 0.6))
    """Least change of the chip, largest fluctuation and least coherence of a vibration that cannot be noise of a stable
    cut: the smaller it is, the steadier it must be. Cutting forces that vary by 3 % from pass to pass change the chip
    by less than a tenth in nearly all stable cuts, and fluctuate by 1."""
    single_line_change: float = 0.2
    """Change of the chip by one line with more than half of the motion, above which it is chatter without side lines.
    """

    # envelopes of narrow bands
    band_width: float = 0.1
    """Half width of a band over its middle: it holds a mode damped by 5 %, and chatter whose frequency wanders."""
    band_share: float = 0.1
    """Share of the motion from which a band is tested."""
    noise_p_value: float = 0.05
    """p-value of a steady envelope above which a vibration may be noise,"""
    envelope_degrees: int = 14
    """with so many degrees of freedom that the p-value of a limit cycle with ``steady`` power is below 0.001."""

    # motion that alternates from tooth to tooth
    alternating: float = 0.5
    """Alternating motion over all other motion, below which unequal teeth explain it."""
    unequal_teeth: float = 0.3
    """Size of orders that unequal teeth alone cause, over the alternating motion, from which the teeth cause both."""
    negligible_alternation: float = 0.05
    """Alternating motion over all other motion, up to which alternation is ignored."""
    out_of_the_cut: float = 0.5
    """Change of the chip from tooth to tooth, over the thickest chip, above which teeth leave the cut."""
    amplified_runout: tuple[float, float] = (8.0, 1.5)
    """That change over twice the stated runout, above which it is not runout amplified by a mode: for two teeth, for
    more teeth. An eccentric spindle causes a force at half the tooth passing with two teeth alone (two of 300 stable
    cuts amplified it more). With more teeth it causes the orders next to the tooth passing."""

    # recordings without chatter
    hidden_line: float = 0.15
    """Share of the motion that a line could have without being significant, above which the cut is not judged."""
    unexplained: float = 0.5
    """Share of the motion that does not repeat, above which a cut is not called stable."""
    irregular_share: float = 0.4
    """Share of the motion that does not repeat from which irregular chatter is considered."""
    irregular_change: float = 0.5
    """Change of the chip by motion that neither repeats nor is a line, from which it is irregular chatter."""
    irregular_power: float = 3.0
    """Mean power of neighbouring lines over the wide floor above which they count as irregular motion."""

    # windows of a cut that is being recorded
    online_window: float = 0.4
    """Least duration of a window, s."""
    online_hop: float = 0.1
    """Time from window to window, s."""
    online_highest: float = 5000.0
    """Highest frequency of chatter that is searched, Hz."""
    online_confirmed: int = 3
    """Number of windows in a row after which chatter is announced."""
    online_longer: int = 4
    """Number of windows' lengths that are judged together, where a cut chatters before it was stable at this speed."""
    online_open: int = 5
    """Number of windows in a row after which an open verdict, or the end of chatter, is announced."""
    online_growth: float = 2.0
    """Size of the orders at one end of a window over that at the other, from which the tool enters or leaves."""
    online_rise: float = 3.0
    """Size of the motion that does not repeat over that of the stable cut before, from which it is chatter: the growth
    that shows chatter within a recording."""
    online_stable: int = 50
    """Number of stable windows with which later ones are compared: five seconds."""
    online_memory: int = 6000
    """Number of windows whose size is remembered, to distinguish an idle spindle: ten minutes."""

    # depth of cut fitted with a model
    equal_misfit: float = 1.5
    """Misfit over the least misfit up to which another angle of the spindle is accepted."""
    depth_errors: float = 3.0
    """Half width of the interval of the depth in standard errors. With models as inaccurate as fits are, it contained
    the true depth in 200 of 233 simulated cuts."""
    largest_misfit: float = 0.1
    """Misfit from which model and recording do not agree."""
    least_orders: int = 4
    """Least number of significant orders for a fit of the depth."""
    widest_depth: float = 10.0
    """Upper end of the depth's interval over the fitted depth, above which the fit is not used."""


THRESHOLDS = ChatterSettings()


@dataclass(frozen=True)
class LearningSettings:
    """Errors of verdicts and frequencies, and the size of the sample, where cuts in production are data."""

    wrong_verdict: float = 0.01
    """Probability of a wrong verdict: of 200 simulated cuts far from the limit one was judged wrongly
    (tests/stability/chatter/test_chatter_trial.py)."""
    undecided_growth: float = 0.01
    """Standard deviation of the growth a period (logarithm of the largest multiplier's modulus) at which a cut begins
    to chatter: that trial holds no cut with a growth within 0.02, so that verdicts there are not known."""
    line_at_limit: float = 0.002
    """Relative standard error of a predicted chatter frequency at the limit."""
    line_above_limit: float = 0.1
    """By how much this error rises with the growth a period; both from 169 simulated cuts in which teeth leave the cut
    (benchmarks/learning_trial)."""
    other_line: float = 0.2
    """Probability that the strongest line is none of the predicted ones: of these cuts, a tenth up to a growth of 0.4,
    and half above."""
    draws: int = 200
    """Structures in a sample."""
    enough: float = 0.5
    """Effective share of the sample from which draws are not moved."""
    least_effective: int = 78
    """Effective draws below which nothing is concluded: twice the 39 that advise a cut."""
    most_moves: int = 40
    """Largest number of moves of each draw for a power of the likelihood."""
    accepted: float = 0.25
    """Share of proposals that is accepted, to which the step is set; a quarter to a third is best for many parameters
    (Roberts & Rosenthal, Statistical Science 16, 2001)."""
    contradiction: float = 0.01
    """Probability, over all cuts together, below which a verdict contradicts the model."""


LEARNING = LearningSettings()
