"""Effects of a robot on a part: deviation of drilled holes, its uncertainty, compensated paths."""
