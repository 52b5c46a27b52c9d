"""Faults of a recording itself: tones from elsewhere and channels that saturate."""
