"""The robot models on the command line: commands, pictures, an interactive page, maps of depth limits."""
