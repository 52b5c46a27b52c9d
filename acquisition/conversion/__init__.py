"""Conversion between recordings and the files other programs read and write."""

from .convert import convert
from .mapping import ArrayMapping, ChannelMapping, Mapping, load_mapping

__all__ = ["ArrayMapping", "ChannelMapping", "Mapping", "convert", "load_mapping"]
