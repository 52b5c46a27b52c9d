from .band_of_frf import known_band
from .frf import Frf, FrfCovariance
from .frf_file import read_frf, write_frf
from .quantities import FRF_ORDERS, correct_high_pass, frf_quantity, to_receptance
from .transfer_units import EXCITATIONS, family_of, quantities_of_unit
from .uff_file import is_uff_number, uff_node_numbers, write_frf_uff

__all__ = [
    "EXCITATIONS",
    "FRF_ORDERS",
    "Frf",
    "FrfCovariance",
    "correct_high_pass",
    "family_of",
    "frf_quantity",
    "is_uff_number",
    "known_band",
    "quantities_of_unit",
    "read_frf",
    "to_receptance",
    "uff_node_numbers",
    "write_frf",
    "write_frf_uff",
]
