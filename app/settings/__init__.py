"""What a person sets: one strict tree of settings, rig files and calibrations; the only readers of TOML."""
