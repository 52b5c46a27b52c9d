"""Stability solvers, one method a file, and the boundary that they trace over spindle speed."""
