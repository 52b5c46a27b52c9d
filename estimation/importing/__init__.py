"""FRFs of other programs: UFF, MAT, NPZ, CSV and the text exports of analysers."""
