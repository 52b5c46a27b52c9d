"""A tooth period as a linear operator, its Floquet multipliers, and the depths at which they cross the unit circle."""
