"""Text in a terminal, and results in a notebook."""
