"""All kinds of TOML files, with purpose and schema."""

from millfrf.core.described_tables import TomlFile


def toml_files() -> tuple[TomlFile, ...]:
    """Return all kinds of TOML files that commands read, in the usual order of work."""
    from acquisition import LogMapping, RecordingMapping, Session
    from estimation import FrfMapping, GeometryTable
    from millfrf.campaign.campaign_tables import CampaignFile
    from millfrf.cutting import CuttingTable
    from millfrf.robot_model import PlanarFile, SerialFile, SpatialFile
    from millfrf.steps.plan import PlanTable
    from millfrf.steps.tap_points import PointsTable
    from modal_fit import PolesFile

    cuts = ("lobes", "chatter", "plan", "report", "cut diagnose", "robot lobes", "robot path")
    robots = ("robot modes", "robot frf", "robot lobes", "robot map", "robot update", "robot path")
    return (
        TomlFile("mapping", "which array or column of a file is which channel", RecordingMapping, "", ("convert",)),
        TomlFile("frf-mapping", "where another program's file holds FRFs", FrfMapping, "", ("convert",)),
        TomlFile("can-mapping", "which signals of a CAN log go into a recording", LogMapping, "", ("convert",)),
        TomlFile("cut", "cutter, engagement and force coefficients", CuttingTable, "cutting", cuts),
        TomlFile("plan", "what sweeps of the spindle speed shall measure", PlanTable, "plan", ("plan",)),
        TomlFile("session", "what is recorded, from which devices", Session, "", ("acquire",)),
        TomlFile("points", "which point was hit in which recording", PointsTable, "", ("tap",)),
        TomlFile("geometry", "where the nodes are, and which lines join them", GeometryTable, "", ("report",)),
        TomlFile("poles", "poles that are chosen by hand", PolesFile, "", ("fit",)),
        TomlFile("robot-serial", "a robot joint by joint, as `new robot` writes it", SerialFile, "", robots),
        TomlFile("robot-spatial", "a robot with closed loops, beams and own nodes", SpatialFile, "", robots),
        TomlFile("robot-planar", "a robot that moves in a plane", PlanarFile, "", robots),
        TomlFile("campaign", "many recordings, and the jobs that are done with them", CampaignFile, "", ("campaign",)),
    )
