"""The tooth period as an operator, its Floquet multipliers, and the depths at which cuts grow."""
