"""Depth limits that were verified with Floquet multipliers, and what is done where two methods disagree."""
