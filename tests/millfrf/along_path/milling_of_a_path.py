"""The cut of these tests: aluminium, half immersion down, two teeth; assumed numbers."""

CUT = """[cutting]
teeth = 2
diameter_m = 0.012
edge_angle_deg = 90.0
ktc_pa = 600e6
krc = 0.3
kac = 0.1
start_angle_deg = 90.0
exit_angle_deg = 180.0
feed_per_tooth_m = 0.1e-3
"""
