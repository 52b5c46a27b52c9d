from .make import SimulatedCampaign, laboratory_of, make_campaign
from .recordings import CUTTER, Laboratory
from .true_robot import Condition, TrueRobot

__all__ = ["CUTTER", "Condition", "Laboratory", "SimulatedCampaign", "TrueRobot", "laboratory_of", "make_campaign"]
