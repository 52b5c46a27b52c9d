"""FRFs of Universal File Format files, with their coherences and units."""
