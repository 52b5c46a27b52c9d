"""Results of a stability analysis: lobes over spindle speed, all limits at one speed, and their files."""
