"""Tools as beams, coupled to the receptance of a spindle or robot that taps on simple tools show."""
