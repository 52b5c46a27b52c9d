"""Numbers that decide something in the robot models: thresholds, tolerances and priors, each with unit and reason."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class StructureSettings:
    """Settings of robot files, kinematics, structure and modes."""

    # largest values that a file or a command may give: beyond them a unit was mistaken
    largest_angle: float = 1080.0  # of a revolute joint, degrees: three turns
    largest_travel: float = 50.0  # of a prismatic joint, m
    looks_like_radians: float = 6.3  # degrees; if no joint angle is larger, radians may have been meant
    largest_payload: float = 1e4  # kg
    largest_payload_distance: float = 5.0  # of the payload's centre from the tool tip, m
    smallest_inertia: float = 1e-12  # largest entry of an inertia matrix, kg m^2
    largest_inertia: float = 1e5
    massless_link: float = 1e-6  # kg; lighter links of a URDF only carry frames
    same_place: float = 1e-6  # m; two places at a smaller distance count as equal

    largest_place: float = 20.0  # coordinate of a tool path, m
    most_path_points: int = 20_000

    # kinematics
    closed_loop: float = 1e-12  # largest gap of a closed loop, m and rad
    near_singularity: float = 0.02  # smallest singular value of the Jacobian (m, rad) that gives no warning
    iterated_error: float = 1e-10  # largest error of `inverse_kinematics`, m and rad
    reached_error: float = 1e-9  # largest error of a posture that reaches its target, m and rad
    same_posture: float = 1e-5  # rad and m; postures with smaller joint differences count as equal
    reaching_starts: int = 48  # starts of `reach` over the joint ranges, in addition to the given start
    branch_starts: int = 12  # starts of the search for all branches without a closed form
    unlimited_travel: float = 2.0  # half range of the starts of a prismatic joint without limits, m
    wrist_rounding: float = 1e-4  # deviation from a spherical wrist by rounding, rad and m: 1.5708 for a quarter turn
    branch_switch: float = 1.0  # joint motion between neighbouring places that is a change of branch, rad

    # tool paths and their compensation
    corrected_error: float = 1e-9  # largest error of a corrected place, m and rad
    path_warnings: int = 5  # warnings that a compensated path shows one by one
    same_point: float = 1e-9  # m; neighbouring points of a path at a smaller distance count as equal
    plunge: float = 0.05  # sine of the angle between feed and tool below which the tool plunges
    path_starts: int = 4  # starts of the iterated search for postures at one angle
    path_same_posture: float = 1e-4  # rad; postures of this search with smaller joint differences count as equal

    # structure and modes
    planar_elements: int = 4  # beam elements of a planar link: first modes within 1e-4 of those of the exact chain
    planar_band: float = 1500.0  # Hz; modes above are static flexibility: four elements put them over 3 % too high
    high_mode: float = 20.0  # Hz; above, large Rayleigh damping gives a warning
    large_damping: float = 0.2  # damping ratio of a high mode that gives a warning
    tool_mass: float = 0.2  # of a small end mill with collet, kg: on 0.1 um/N its mode is at 1.1 kHz, above the band
    rigid_tool_compliance: float = 1e-12  # compliance of a tool that counts as rigid, m/N
    cell_band: float = 2000.0  # highest natural frequency of the simulated cell, Hz


ROBOT = StructureSettings()


@dataclass(frozen=True)
class TypicalRobots:
    """What industrial robots have in common, for assumptions and doubts about a new robot file."""

    # Joint stiffness over the torque of the rated payload at the reach, 1/rad: the order of identified values of KUKA
    # KR 240-2, KR 270 and KR 500 (Dumas 2011, Klimchik 2013, Jubien 2014). A choice of this project: the papers'
    # tables were not at hand to check it.
    arm_stiffness: float = 400.0
    wrist_stiffness: float = 80.0
    rail_stiffness: float = 6e7  # N/m; rack-and-pinion or ball-screw drive of a linear axis
    stiffness_factor: float = 3.0  # factor of uncertainty of the assumed stiffness; a choice of this project
    reach_postures: int = 1024  # the longest of them is some per cent shorter than the stretched arm
    least_reach: float = 0.1  # m; shorter rows of joints have their centres in one place

    # Mass of 29 robots of 25 to 8600 kg by KUKA, ABB, FANUC, Staubli and Yaskawa, least squares (their data sheets were
    # not at hand to check each figure):
    # log(mass/kg) = a + b log(reach/m), or a + b log(reach/m) + c log(payload/kg), and its residual with its freedom
    mass_over_reach: tuple[float, float] = (4.363, 2.962)
    mass_over_reach_residual: tuple[float, int] = (0.447, 27)
    mass_over_payload: tuple[float, float, float] = (3.627, 1.639, 0.397)
    mass_over_payload_residual: tuple[float, int] = (0.319, 26)
    mass_level: float = 0.99  # share of robots whose mass raises no doubt
    mass_to_payload: float = 5.0  # of moving bodies, where the payload is not stated
    light: float = 3.0  # moving mass over squared length, kg/m^2, below which it is a placeholder; cobots have 10 to 20
    axis_error: float = 1e-3  # sine of the angle between flange and last joint that rounding explains


TYPICAL = TypicalRobots()


@dataclass(frozen=True)
class IdentificationSettings:
    """Identification of parameters from deflections, frequencies and FRFs."""

    identifiable_error: float = 1.0  # standard error of a logarithm above which a direction is unidentifiable: factor e
    fewest_postures: int = 10  # postures below which none is held out
    held_out_every: int = 5  # one posture in so many is held out


def _least_difference() -> Mapping[str, float]:
    return {
        "stiffness": 0.03,
        "joint damping": 0.004,
        "damping": 0.10,
        "links": 0.05,
        "payload": 0.5,
        "tool mass": 0.3,
        "tool": 5e-9,
        "base": 5e-10,
        "inertia": float("inf"),
        "sprung mass": float("inf"),
    }


@dataclass(frozen=True)
class UpdateSettings:
    """Update of a robot's file, the uncertainty that it leaves, and single causes."""

    noise_ratio: float = 1.2  # error over expected error, held out and fitted, up to which an update explains the error
    largest_remaining_share: float = (
        0.5  # share of the squared error beyond noise that may remain where an update is "partly explained"
    )
    largest_expected_error: float = (
        1.2  # largest expected error over the noise: up to a fifth more than noise for undetermined parameters
    )
    significance: float = 0.005  # probability that a correct file gets any name (Bonferroni 1936)
    least_difference: Mapping[str, float] = field(  # smallest difference that is named, by kind, in its unit:
        default_factory=_least_difference  # files are not known better than this
    )
    determined_ratio: float = 0.5  # posterior over prior deviation below which a parameter is determined
    undetermined_ratio: float = 0.5  # the same ratio of a direction, above which it is reported as undetermined
    least_line_error: float = 1e-3  # least error of a line over the size of its matrix: calibration, linearity, posture
    stages: tuple[float, ...] = (0.05, 0.02, 0.02, 0.01, 0.005)  # relative error of modes allowed in each search stage
    least_modes_off: float = 7e-4  # relative error of a correct model's modes: one beam element a link, 0.02 to 0.15 %
    restart_ratio: float = 1.3  # error over the noise from which further starts are tried
    least_compliance: float = 1e-13  # compliance that counts as rigid, m/N or rad/(N m)
    equivalent_chi_square: float = 6.0  # rise of chi^2 up to which causes are equivalent: likelihood ratio 20


@dataclass(frozen=True)
class PostureProcessSettings:
    """Gaussian process over postures; errors of modes are (frequency, damping ratio, shape)."""

    least_errors: tuple[float, float, float] = (1e-3, 0.03, 0.03)  # relative: posture, temperature and clamping vary
    assumed_errors: tuple[float, float, float] = (3e-3, 0.1, 0.1)  # relative, where a modal model has no covariance
    pairing_scales: tuple[float, float] = (0.12, 0.35)  # differences of log frequency and of shape that count equally
    learned_pairing_scales: tuple[float, float] = (0.05, 0.3)  # the same for a model that measurements corrected
    largest_frequency_ratio: float = 0.5  # logarithm of a ratio of frequencies beyond which modes are never paired
    n_basis_modes: int = 24  # lowest modes of a basis, which the static deflection of each joint completes
    least_arc: float = 0.15  # least weight of a joint: a turn that does not move the tip turns masses and springs
    least_load: float = 20.0  # N m: least scale of a weight's moment about a joint
    close_squares: float = 0.02  # relative distance of squared frequencies that limits the derivatives of shapes
    assumed_damping: float = 1e-4  # least damping ratio: its logarithm must be finite if a file gives no damping
    rounds: int = 3  # rounds of unknowns and hyperparameters in turn
    steps: int = 4  # Gauss-Newton steps of each round
    largest_step: float = 0.25  # largest change of a logarithm in one step
    hyperparameter_draws: int = 24
    proposal_freedom: float = 5.0  # degrees of freedom of the t distribution that proposes these draws
    model_draws: int = 240  # modal models that a prediction draws
    exact_variance: float = 0.02  # variance, as a share, of a measurement that counts as exact
    far: float = 0.5  # share of the variance over postures, left by exact measurements, from which a posture is far
    highest_mode: float = 2.0  # predicted modes over the highest measured frequency; higher modes are static
    n_lowest: int = 3  # modes that limit the depth of a cut on a robot
    n_measurable: int = 6  # modes that a measurement is expected to give at most
    fewest_left_out: int = 3  # postures below which none is left out
    same_posture: float = 1e-3  # rad or m: difference of joint values up to which two measurements share a posture
    same_robot: float = 1e-4  # relative difference of modelled frequencies up to which two robots are the same


IDENTIFICATION = IdentificationSettings()
UPDATE = UpdateSettings()
POSTURES = PostureProcessSettings()
