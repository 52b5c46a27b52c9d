"""The tables of CAMPAIGN.toml, checked by pydantic: a table that is absent is a job that is not done."""

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
    """What the campaign is called, and the robot that it measures."""

    title: str = "Campaign"
    robot: Text | None = None


class RecordingsTable(_Table):
    """Recordings by name, and where their labels come from."""

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
    """Labels by which recordings belong together; none: each recording is a set of its own."""

    by: list[Text] = Field(default_factory=list)


class EstimateTable(_Banded):
    """Options of ``millfrf estimate``; and how long the parts are into which a long recording is split."""

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
    """Options of ``millfrf fit``."""

    band_hz: FrequencyBand = Field(validation_alias=AliasChoices("band_hz", "band"))
    method: Literal["polyreference", "subspace"] | None = None
    max_order: Annotated[int, Field(ge=1)] | None = None
    modes: Annotated[int, Field(ge=1)] | None = None
    excitation: list[Text] = Field(default_factory=list)
    response: list[Text] = Field(default_factory=list)
    stream: Text | None = None


class CalibrateTable(_Table):
    """Hammer FRFs by which a model is carried to the tool tip; names of files may hold labels in braces."""

    tip: Text
    sensor: Text


class LobesTable(_Table):
    """Options of ``millfrf lobes``."""

    cutting: Text
    speeds_rpm: tuple[Positive, Positive, Annotated[int, Field(ge=1)]]
    max_depth_m: Positive
    method: str = "certified"


class DiagnoseTable(_Banded):
    """Options of ``millfrf diagnose``; ``by``: labels of the recordings that are diagnosed together."""

    model: Text
    by: list[Text] | None = None
    band_hz: FrequencyBand | None = Field(None, validation_alias=AliasChoices("band_hz", "band"))
    lab_error: tuple[Share, Share, Share] = (0.01, 0.12, 0.03)
    cutting: Text | None = None
    stream: Text | None = None


class RobotDiagnoseTable(_Banded):
    """Options of ``millfrf robot diagnose``; ``by``: labels of the recordings that are diagnosed together."""

    by: list[Text] = Field(default_factory=list)
    feed_deg: Finite | None = None
    band_hz: FrequencyBand | None = Field(None, validation_alias=AliasChoices("band_hz", "band"))
    sensor_m: Place | None = None
    payload_at_m: Place | None = None
    rigid_links: bool = False
    model_error: tuple[Share, Share, Share] = (0.01, 0.15, 0.05)
    stream: Text | None = None


class LearnTable(_Table):
    """Options of ``millfrf robot learn``."""

    feed_deg: Finite | None = None


class ReportTable(_Table):
    """The table of modes and the report over all sets."""


class CampaignFile(_Table):
    """The whole file."""

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
