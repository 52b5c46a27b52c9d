"""Update of all uncertain parameters of a robot, from FRFs and modal models in one or more postures."""
