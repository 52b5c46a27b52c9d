"""Roots of the characteristic function: all depths at which a multiplier crosses the unit circle."""
