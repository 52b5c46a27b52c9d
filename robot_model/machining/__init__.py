"""What a robot does to a part: postures for a cut, deviation of drilled holes, its uncertainty, compensated paths."""
