"""Kinematics of any mechanism: frames, loops, joint values and inverse solutions."""
