from .earlier_tests import SPEED_EVENTS, SessionTest, SetUp, force_power, read_test, tests_beside
from .milled_speeds import MilledSpeeds
from .planned_sweeps import SessionPlan, session_plan
from .session_tests import SessionTests
from .standing import COLUMNS, Standing, TestRow, standing_of

__all__ = [
    "COLUMNS",
    "SPEED_EVENTS",
    "MilledSpeeds",
    "SessionPlan",
    "SessionTest",
    "SessionTests",
    "SetUp",
    "Standing",
    "TestRow",
    "force_power",
    "read_test",
    "session_plan",
    "standing_of",
    "tests_beside",
]
