"""Diagnosis of a structure: a modal model compared with recordings of forces and responses."""
