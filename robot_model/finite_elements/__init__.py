"""Finite elements of a robot: sections, beams, matrices, gravity, constraints, damping and reduction to modes."""
