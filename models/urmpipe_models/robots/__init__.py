"""Arms in files: the catalogue, TOML and URDF, in and out."""
