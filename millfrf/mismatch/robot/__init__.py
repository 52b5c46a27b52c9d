"""Diagnosis of a robot's model: recordings in several postures against a few parameters of the robot."""
