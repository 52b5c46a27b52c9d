"""The simulated laboratory: sensors, signal chain, and the set-up that it notes down."""
