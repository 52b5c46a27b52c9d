"""Milling tests of a simulated robot that hides one effect, for blind trials of the diagnosis."""
