"""The tables of CAMPAIGN.toml, checked by pydantic; `millfrf new schemas` and the reference read their docstrings."""

from typing import TYPE_CHECKING, Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

from millfrf.core.step_tables import StepTable, table_of
from millfrf.steps.calibrate import calibrate
from millfrf.steps.diagnose import diagnose
from millfrf.steps.estimate import estimate
from millfrf.steps.fit import fit
from millfrf.steps.lobes import lobes
from millfrf.steps.robot.diagnose import diagnose_robot
from millfrf.steps.robot.learn import learn_postures

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Text = Annotated[str, Field(min_length=1)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class CampaignTable(_Table):
    """Title and robot of the campaign.

    Parameters
    ----------
    title
        Title of the report.
    robot
        Name of a built-in robot, or a robot file relative to the folder of this file; for postures, ``learn`` and
        ``robot_diagnose``.
    """

    title: str = "Campaign"
    robot: Text | None = None


class RecordingsTable(_Table):
    """Recordings, and the sources of their labels.

    Parameters
    ----------
    files
        Names of recordings relative to the folder of this file, with wildcards such as ``recordings/*.h5``.
    pattern
        Regular expression for names without suffix; each named group such as ``(?P<pose>P\\d+)`` is a label.
    table
        CSV table with the column ``file``; each other column is a label.
    setup
        Labels from the setup text of a recording, each with its dotted key, such as ``pose = "robot.pose"``.
    """

    files: list[Text] = Field(default_factory=list)
    pattern: Text | None = None
    table: Text | None = None
    setup: dict[str, Text] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _names_files(self) -> "RecordingsTable":
        if not self.files and self.table is None:
            raise ValueError('names no recordings; give files = ["recordings/*.h5"], or a table with a column file')
        return self


class SetsTable(_Table):
    """Labels by which recordings are grouped; without labels each recording is a set.

    Parameters
    ----------
    by
        Labels with equal values in one set: its recordings are averaged to one FRF and one fit.
    """

    by: list[Text] = Field(default_factory=list)


class _Parts(StepTable):
    """Options of a table that only a campaign has.

    Parameters
    ----------
    part_s : s
        A longer recording is split into parts of about this duration; each part is a task.
    """

    part_s: Positive = 900.0


class _Groups(StepTable):
    """Options of a table that only a campaign has.

    Parameters
    ----------
    by
        Labels by which recordings are grouped for the diagnosis; default: as for the sets; empty: all together.
    """

    by: list[Text] | None = None


class _SetsPerPose(StepTable):
    """Options of a table that only a campaign has.

    Parameters
    ----------
    sets_per_pose
        Number of sets used of each posture (the first ones). The time increases with its third power, and repeats
        contain little information on other postures.
    """

    sets_per_pose: Annotated[int, Field(ge=1)] = 1


if TYPE_CHECKING:  # the tables are created from the steps, which describe their options
    EstimateTable = _Parts
    FitTable = StepTable
    CalibrateTable = StepTable
    LobesTable = StepTable
    DiagnoseTable = _Groups
    RobotDiagnoseTable = _Groups
    LearnTable = _SetsPerPose
else:
    EstimateTable = table_of(estimate, "EstimateTable", base=_Parts, without=("recordings",))
    FitTable = table_of(fit, "FitTable", without=("sources", "poles", "refine"), needed=("band",))
    CalibrateTable = table_of(calibrate, "CalibrateTable", without=("model",))
    LobesTable = table_of(lobes, "LobesTable", without=("dynamics",), needed=("speeds", "max_depth"))
    DiagnoseTable = table_of(
        diagnose, "DiagnoseTable", base=_Groups, without=("recordings", "simulated", "figure_format")
    )
    RobotDiagnoseTable = table_of(
        diagnose_robot,
        "RobotDiagnoseTable",
        base=_Groups,
        without=("robot", "recordings", "poses", "figure_format"),
        former={"channels_turned": "feed_deg", "sensor_at": "sensor_m"},
    )
    LearnTable = table_of(
        learn_postures,
        "LearnTable",
        base=_SetsPerPose,
        without=("robot", "models", "poses", "next", "x", "y", "z"),
        former={"channels_turned": "feed_deg"},
    )


class ReportTable(_Table):
    """Table of modes and report over all sets."""


class CampaignFile(_Table):
    """A campaign file; a job without its table is not done.

    Parameters
    ----------
    campaign
        Title and robot of the campaign.
    recordings
        Recordings and their labels; several tables are possible.
    sets
        Labels that recordings of one set share.
    estimate
        FRF of each set.
    fit
        Modal model of each set, from its FRF or its recordings.
    calibrate
        Model of each set at the tool tip.
    lobes
        Depth limits of each set.
    diagnose
        Diagnosis of a nominal model with grouped recordings.
    robot_diagnose
        Diagnosis of the robot model with grouped recordings.
    learn
        Dynamics over postures from the models of all sets.
    report
        Table of modes and report over all sets.
    """

    campaign: CampaignTable = CampaignTable()
    recordings: Annotated[list[RecordingsTable], Field(min_length=1)]
    sets: SetsTable = SetsTable()
    estimate: EstimateTable | None = None
    fit: FitTable | None = None
    calibrate: CalibrateTable | None = None
    lobes: LobesTable | None = None
    diagnose: DiagnoseTable | None = None
    robot_diagnose: RobotDiagnoseTable | None = None
    learn: LearnTable | None = None
    report: ReportTable | None = None

    @model_validator(mode="after")
    def _what_jobs_need(self) -> "CampaignFile":
        if self.fit is not None and self.fit.options["method"] == "polyreference" and self.estimate is None:
            raise ValueError('[fit] method = "polyreference" fits FRFs; add [estimate], or use method = "subspace"')
        for job in ("calibrate", "lobes", "learn"):
            if getattr(self, job) is not None and self.fit is None:
                raise ValueError(f"[{job}] needs modal models; add [fit]")
        for job in ("robot_diagnose", "learn"):
            if getattr(self, job) is not None and self.campaign.robot is None:
                raise ValueError(f'[{job}] needs a robot; add robot = "NAME or FILE" to [campaign]')
        if not any(getattr(self, job) is not None for job in JOBS):
            raise ValueError(f"the file has no job; add one of {', '.join(f'[{job}]' for job in JOBS)}")
        return self


# names of the jobs' tables, in the order in which results are needed
JOBS = ("estimate", "fit", "calibrate", "lobes", "diagnose", "robot_diagnose", "learn", "report")
