"""In-process modes and hammer tests joined in one model of the tool tip."""
