"""The systems that are shipped: one TOML file each."""
