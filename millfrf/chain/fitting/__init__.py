"""From an FRF or recordings to a modal model at the tool tip."""
