"""Robots in space: structure in a posture, modes, weight, and a compliant tool."""
