"""Forced vibration of a cut: simulation in time with loss of contact, and the error of the wall that is left."""
