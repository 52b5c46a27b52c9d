"""What keeps a recording file safe: syncs and locks while it is written, and careful reading of damaged files."""
