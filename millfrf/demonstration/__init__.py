"""Demonstrations on the simulated cell: all steps in sequence, and the blind diagnosis of a concealed effect."""
