"""Trial of `robot update` on cells that share no code with the robot model: own finite elements, own integration."""
