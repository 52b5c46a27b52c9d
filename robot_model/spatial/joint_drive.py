"""`JointDrive`: the motor of a joint, its gear, and the controller that holds it."""

from dataclasses import dataclass

from foundation import InputError


@dataclass(frozen=True)
class JointDrive:
    """Motor behind the gear of a driven joint, held by the controller.

    Parameters
    ----------
    motor_inertia : kg m^2
        Moment of inertia J of what turns with the motor: rotor, brake, coupling, the gear's fast side.
    gear_ratio
        N: turns of the motor over those of the joint; rad/m for a prismatic joint.
    position_gain : N m/rad or N/m
        Static stiffness K_pos with which the controller holds the motor, on the joint's side.

    Raises
    ------
    InputError
        A number that is not positive and finite.
    """

    motor_inertia: float
    gear_ratio: float
    position_gain: float

    def __post_init__(self) -> None:
        for name in ("motor_inertia", "gear_ratio", "position_gain"):
            if not 0 < getattr(self, name) < float("inf"):
                raise InputError(f"drive: {name} = {getattr(self, name)!r} must be positive and finite")

    @property
    def reflected_inertia(self) -> float:
        """``N^2 J`` on the joint's side, kg m^2 or kg.

        Examples
        --------
        >>> round(JointDrive(0.004, 200.0, 1e7).reflected_inertia, 6)
        160.0
        """
        return self.gear_ratio**2 * self.motor_inertia
