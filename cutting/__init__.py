"""Milling forces and directional coefficients: knows nothing of structures."""

from cutting.milling_process import MillingProcess

__all__ = ["MillingProcess"]
