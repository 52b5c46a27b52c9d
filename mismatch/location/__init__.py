"""Where a mismatch sits: frequency bands, channels, times, levels, spindle orders."""
