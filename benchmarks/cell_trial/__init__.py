"""Random robot cells from recordings to a recommended cut, judged by a solution and a simulation of their own."""
