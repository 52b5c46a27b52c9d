"""Gaussian processes over postures: from modes measured in some postures to modes in all, with bands."""
