"""Exact dynamic stiffness of beams and receptance coupling: the reference for the finite elements."""
