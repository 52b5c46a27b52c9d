"""Finite elements of a robot: sections, beams, gravity, constraints, damping and reduction to modes."""
