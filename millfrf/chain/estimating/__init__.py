"""From recordings to an FRF file."""
