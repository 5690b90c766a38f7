"""Arms: the chain of frames and joints, its geometric models, and placeholder solids."""
