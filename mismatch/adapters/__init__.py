"""What each kind of comparison gives to the inference: a structure, a robot, a cut."""
