"""Roots of the characteristic function: all depths and frequencies at which a multiplier crosses the unit circle."""
