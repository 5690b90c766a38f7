"""Accuracy: how far an arm with drives is from its path at which speed, and how all that shows."""
