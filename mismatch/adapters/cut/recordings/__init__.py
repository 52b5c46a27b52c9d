"""Recordings of cuts: forces, the tip's motion, the spindle's angle."""
