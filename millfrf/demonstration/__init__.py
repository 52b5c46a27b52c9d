"""Demonstrations on the simulated cell: the whole chain, and the blind diagnosis of a concealed effect."""
