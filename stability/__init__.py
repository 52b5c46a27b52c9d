"""Stability lobes from modal models and measured FRFs: knows nothing of acquisition hardware."""

from stability.stability_lobes import StabilityLobes

__all__ = ["StabilityLobes"]
