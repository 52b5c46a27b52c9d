"""Keys of a joint's drive in a robot's file: motor inertia, gear ratio, and the controller's hold on the motor."""

from pydantic import Field

from foundation import InputError

from ..kinematics import Frame
from ..spatial import JointDrive
from .robot_files import Table


class DriveKeys(Table):
    """Optional keys of a ``[[joints]]`` table: the first two and one gain, or none of them.

    Parameters
    ----------
    motor_inertia_kg_m2 : kg m^2
        Inertia of what turns with the motor.
    gear_ratio
        Turns of the motor over those of the joint; rad/m for a prismatic joint.
    position_gain_nm_per_rad : N m/rad
        Static stiffness with which the controller holds the motor of a revolute joint, on the side of the joint.
    position_gain_n_per_m : N/m
        The same for a prismatic joint.
    """

    motor_inertia_kg_m2: float | None = Field(None, gt=0, le=1)
    gear_ratio: float | None = Field(None, ge=1)
    position_gain_nm_per_rad: float | None = Field(None, gt=0)
    position_gain_n_per_m: float | None = Field(None, gt=0)


def drive_of(row: DriveKeys, frame: Frame | None) -> JointDrive | None:
    """The drive of a joint, or None where its table tells none.

    Parameters
    ----------
    row
        Table of the joint.
    frame
        Frame of the joint; None: a frame that the file does not have, which is refused elsewhere.

    Raises
    ------
    InputError
        A part of the keys, the gain of the other motion, or the drive of a joint that is not driven.
    """
    gains = {"revolute": row.position_gain_nm_per_rad, "prismatic": row.position_gain_n_per_m}
    given = [row.motor_inertia_kg_m2, row.gear_ratio, *gains.values()]
    if frame is None or all(value is None for value in given):
        return None
    if frame.motion == "fixed" or not frame.active:
        raise InputError(f"joint {frame.name} is not driven: leave motor_inertia_kg_m2, gear_ratio and its gain out")
    gain = gains.pop(frame.motion)
    keys = {"revolute": "position_gain_nm_per_rad", "prismatic": "position_gain_n_per_m"}
    if row.motor_inertia_kg_m2 is None or row.gear_ratio is None or gain is None or any(gains.values()):
        raise InputError(
            f"joint {frame.name}: a drive is motor_inertia_kg_m2, gear_ratio and, for a {frame.motion} joint, "
            f"{keys[frame.motion]}: give these three, or none (a motor that is held moves nothing)"
        )
    return JointDrive(row.motor_inertia_kg_m2, row.gear_ratio, gain)
