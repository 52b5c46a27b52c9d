"""Stability of a robot's postures on the command line: lobes, and maps of depth limits."""
