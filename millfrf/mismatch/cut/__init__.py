"""Diagnosis of cutting forces: measured forces of a cut against those of a cutting process."""
