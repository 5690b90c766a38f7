"""What a co-simulation recorded, and how its signals are grouped."""
