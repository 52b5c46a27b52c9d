"""Postures along a tool path: their depth limits and deviations, and the best sequence by dynamic programming."""
