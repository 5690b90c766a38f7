"""Options that commands share: their types, and groups of them that a command takes as one object."""
