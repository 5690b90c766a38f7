"""Iterative solutions of any arm, many targets at once."""
