from .beside_free_forms import Gains, gains_beside_laws

__all__ = ["Gains", "gains_beside_laws"]
