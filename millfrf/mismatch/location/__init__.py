"""Location of a mismatch: frequency bands, channels, times, levels, spindle orders."""
