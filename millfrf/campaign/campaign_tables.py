"""The tables of CAMPAIGN.toml, checked by pydantic; `millfrf new schemas` and the reference read their docstrings."""

from typing import Annotated, Literal

from pydantic import AliasChoices, BaseModel, ConfigDict, Field, model_validator

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Share = Annotated[float, Field(gt=0, lt=1)]
Text = Annotated[str, Field(min_length=1)]
FrequencyBand = tuple[Annotated[float, Field(ge=0, allow_inf_nan=False)], Positive]
Place = tuple[Finite, Finite, Finite]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class _Banded(_Table):
    @model_validator(mode="after")
    def _band_is_not_empty(self) -> "_Banded":
        band = getattr(self, "band_hz", None)
        if band is not None and not band[0] < band[1]:
            raise ValueError(f"band_hz [{band[0]:g}, {band[1]:g}] is empty; give [LOW, HIGH]")
        return self


class CampaignTable(_Table):
    """What the campaign is called, and the robot that it measures.

    Parameters
    ----------
    title
        Title of the report.
    robot
        Name of a robot that ships, or a robot file from the folder of this file; for postures, ``learn`` and
        ``robot_diagnose``.
    """

    title: str = "Campaign"
    robot: Text | None = None


class RecordingsTable(_Table):
    """Recordings by name, and where their labels come from.

    Parameters
    ----------
    files
        Names of recordings from the folder of this file, with wildcards such as ``recordings/*.h5``.
    pattern
        Regular expression that is found in names without suffix; each named group such as ``(?P<pose>P\\d+)`` is a
        label.
    table
        CSV table with the column ``file``; each other column is a label.
    setup
        Labels from a recording's setup text: the dotted key there by the label, ``pose = "robot.pose"``.
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
    """Labels by which recordings belong together; none: each recording is a set of its own.

    Parameters
    ----------
    by
        Labels that recordings of one set share: they are stacked to one FRF and one fit.
    """

    by: list[Text] = Field(default_factory=list)


class EstimateTable(_Banded):
    """Options of ``millfrf estimate``; and how long the parts are into which a long recording is split.

    Parameters
    ----------
    segment_s : s
        Duration of a segment; ``segment`` is the same.
    overlap
        Share of a segment that the next one shares, 0 to below 1.
    window
        Window of the segments: ``hann``, ``hamming`` or ``boxcar``.
    stack
        Way of stacking recordings: ``sum`` or ``side-by-side``.
    excitation
        Names of channels that excite; empty: forces and voltages.
    response
        Names of channels that respond; empty: motions.
    band_hz : Hz
        Lowest and highest frequency to keep; without it all lines, which take much room. ``band`` is the same.
    stream
        Sample clock; needed where a recording has several.
    estimator
        Estimator: ``h1``, ``h2``, ``hv``, ``instrumental-variable`` or ``local-polynomial``.
    exclude
        Whether segments with overload, clipping or dropped samples are left out; recordings then stay whole.
    instrument
        Channels that drive the forces, for ``instrumental-variable``.
    part_s : s
        A recording that is longer is split into parts of about this duration, each a task of its own.
    """

    segment_s: Positive = Field(8.0, validation_alias=AliasChoices("segment_s", "segment"))
    overlap: Annotated[float, Field(ge=0, lt=1)] = 0.5
    window: Literal["hann", "hamming", "boxcar"] = "hann"
    stack: str = "sum"
    excitation: list[Text] = Field(default_factory=list)
    response: list[Text] = Field(default_factory=list)
    band_hz: FrequencyBand | None = Field(None, validation_alias=AliasChoices("band_hz", "band"))
    stream: Text | None = None
    estimator: str = "h1"
    exclude: bool = False
    instrument: list[Text] = Field(default_factory=list)
    part_s: Positive = 900.0


class FitTable(_Banded):
    """Options of ``millfrf fit``.

    Parameters
    ----------
    band_hz : Hz
        Lowest and highest frequency of the fit; ``band`` is the same.
    method
        Method: ``polyreference`` of FRFs or ``subspace`` of recordings; without it by whether there is ``[estimate]``.
    max_order
        Highest model order; without it by the data, or the method's own.
    modes
        Number of modes to keep; without it as many as are found.
    excitation
        Names of channels of recordings that excite; empty: chosen by quantity.
    response
        Names of channels of recordings that respond; empty: chosen by quantity.
    stream
        Sample clock; needed where a recording has several.
    """

    band_hz: FrequencyBand = Field(validation_alias=AliasChoices("band_hz", "band"))
    method: Literal["polyreference", "subspace"] | None = None
    max_order: Annotated[int, Field(ge=1)] | None = None
    modes: Annotated[int, Field(ge=1)] | None = None
    excitation: list[Text] = Field(default_factory=list)
    response: list[Text] = Field(default_factory=list)
    stream: Text | None = None


class CalibrateTable(_Table):
    """Hammer FRFs by which a model is carried to the tool tip; names of files may hold labels in braces.

    Parameters
    ----------
    tip
        FRF file: tapped at the tip, motion there; such as ``taps/{pose}_tip.h5``.
    sensor
        FRF file: tapped at the tip, motion at the sensor.
    """

    tip: Text
    sensor: Text


class LobesTable(_Table):
    """Options of ``millfrf lobes``.

    Parameters
    ----------
    cutting
        Cutting file; its name may hold labels in braces.
    speeds_rpm : rpm
        Lowest spindle speed, highest, and how many, a whole number.
    max_depth_m : m
        Largest depth that is looked at.
    method
        Solver by its name, or ``certified``.
    """

    cutting: Text
    speeds_rpm: tuple[Positive, Positive, Annotated[int, Field(ge=1)]]
    max_depth_m: Positive
    method: str = "certified"


class DiagnoseTable(_Banded):
    """Options of ``millfrf diagnose``.

    Parameters
    ----------
    model
        Nominal model; its name may hold labels in braces, such as ``idle/{pose}.json``.
    by
        Labels of recordings that are diagnosed together; without it those of the sets; empty: all together.
    band_hz : Hz
        Band that is compared; without it that of the model. ``band`` is the same.
    lab_error
        What a lab's own fit is off, as shares: frequency, damping, shapes.
    cutting
        Cutting file whose lobes the report shows; its name may hold labels in braces.
    stream
        Sample clock; needed where a recording has several.
    """

    model: Text
    by: list[Text] | None = None
    band_hz: FrequencyBand | None = Field(None, validation_alias=AliasChoices("band_hz", "band"))
    lab_error: tuple[Share, Share, Share] = (0.01, 0.12, 0.03)
    cutting: Text | None = None
    stream: Text | None = None


class RobotDiagnoseTable(_Banded):
    """Options of ``millfrf robot diagnose``.

    Parameters
    ----------
    by
        Labels of recordings that are diagnosed together; empty: all together.
    feed_deg : deg
        Direction of the channels' X axes from the base's x, Z up; without it the base's axes.
    band_hz : Hz
        Band that is compared; without it about the first modes. ``band`` is the same.
    sensor_m : m
        Place of the housing sensor from the tip, in the channels' axes.
    payload_at_m : m
        Place of a payload from the tip, in the tool's frame; without it any place.
    rigid_links
        Whether the model with rigid links is questioned.
    model_error
        What a right model is still off, as shares: frequency, damping, shapes.
    stream
        Sample clock; needed where a recording has several.
    """

    by: list[Text] = Field(default_factory=list)
    feed_deg: Finite | None = None
    band_hz: FrequencyBand | None = Field(None, validation_alias=AliasChoices("band_hz", "band"))
    sensor_m: Place | None = None
    payload_at_m: Place | None = None
    rigid_links: bool = False
    model_error: tuple[Share, Share, Share] = (0.01, 0.15, 0.05)
    stream: Text | None = None


class LearnTable(_Table):
    """Options of ``millfrf robot learn``.

    Parameters
    ----------
    feed_deg : deg
        Direction of the models' X axes from the base's x; without it the base's axes.
    sets_per_pose
        Number of sets of each posture that are learned from, the first ones: time rises with the third power of it, and
        repeats say little of other postures.
    """

    feed_deg: Finite | None = None
    sets_per_pose: Annotated[int, Field(ge=1)] = 1


class ReportTable(_Table):
    """The table of modes and the report over all sets."""


class CampaignFile(_Table):
    """The whole file; a job whose table is absent is not done.

    Parameters
    ----------
    campaign
        Title and robot of the campaign.
    recordings
        Recordings and their labels; several tables for several kinds of names.
    sets
        Labels that recordings of one set share.
    estimate
        FRF of each set.
    fit
        Modal model of each set, of its FRF or of its recordings.
    calibrate
        Model of each set carried to the tool tip.
    lobes
        Depth limits of each set.
    diagnose
        What a nominal model leaves out, of recordings that belong together.
    robot_diagnose
        What the robot's model leaves out, of recordings that belong together.
    learn
        Dynamics over postures, once, with the models of all sets.
    report
        Table of modes and report, once, with the results of all sets.
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
        if self.fit is not None and self.fit.method == "polyreference" and self.estimate is None:
            raise ValueError('[fit] method = "polyreference" fits FRFs; add [estimate], or use method = "subspace"')
        for job in ("calibrate", "lobes", "learn"):
            if getattr(self, job) is not None and self.fit is None:
                raise ValueError(f"[{job}] needs modal models; add [fit]")
        for job in ("robot_diagnose", "learn"):
            if getattr(self, job) is not None and self.campaign.robot is None:
                raise ValueError(f'[{job}] needs a robot; add robot = "NAME or FILE" to [campaign]')
        if not any(getattr(self, job) is not None for job in JOBS):
            raise ValueError(f"no job is asked for; add one of {', '.join(f'[{job}]' for job in JOBS)}")
        return self


JOBS = ("estimate", "fit", "calibrate", "lobes", "diagnose", "robot_diagnose", "learn", "report")
"""Names of the jobs' tables, in the order in which results are needed."""
