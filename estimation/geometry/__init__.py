"""Positions and directions of the measured points, on which mode shapes are drawn."""
