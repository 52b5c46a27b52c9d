"""Conversion between recordings and the files other programs read and write."""
