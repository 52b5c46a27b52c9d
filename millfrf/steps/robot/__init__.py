"""Steps on robot models: postures, receptance, lobes, loads, paths, updates."""
