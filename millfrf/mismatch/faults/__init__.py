"""Faults of the recording itself: foreign tones and saturated channels."""
