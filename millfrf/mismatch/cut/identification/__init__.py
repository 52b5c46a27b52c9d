"""Force coefficients of a cutter from the forces of its own cuts."""
