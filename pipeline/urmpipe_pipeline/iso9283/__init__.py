"""Accuracy and repeatability after ISO 9283, from the cycles of a repeated motion."""
