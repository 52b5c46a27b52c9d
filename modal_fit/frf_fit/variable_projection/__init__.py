"""Variable projection on the measured lines: linear unknowns eliminated, poles and left vectors refined."""
