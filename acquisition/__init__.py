"""Channels, recordings and the sources they come from: knows nothing of spectra or models."""

from acquisition.channel import Channel

__all__ = ["Channel"]
