"""Robots under load on the command line: stiffness, payload, and deviation of drilled holes."""
