"""Sessions: a TOML file that says what is wired where, checked where it enters, and the source it describes."""
