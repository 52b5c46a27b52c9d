"""The tooth period as a linear operator, and its Floquet multipliers."""
