from .published_cut import ACETAL_CUTTER, SWEEP_IMMERSIONS
from .sensors import Sensor, dynamometer, hammer_sensors, housing_accelerometers, milling_sensors, tip_accelerometers
from .setup_notes import cutting_table, setup_text
from .signal_chain import Decimator, SignalChain

__all__ = [
    "ACETAL_CUTTER",
    "SWEEP_IMMERSIONS",
    "Decimator",
    "Sensor",
    "SignalChain",
    "cutting_table",
    "dynamometer",
    "hammer_sensors",
    "housing_accelerometers",
    "milling_sensors",
    "setup_text",
    "tip_accelerometers",
]
