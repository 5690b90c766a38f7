"""Files in: TOML and XML read with every fault and its line."""
