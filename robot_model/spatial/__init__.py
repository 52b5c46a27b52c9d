"""Robots in space: structure at a posture, modes, weight, a compliant tool, and natural coordinates."""
