"""The library of causes: laws of joints, linear causes of the structure, faults of the measuring chain."""
