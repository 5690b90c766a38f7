"""How an arm moves: frames, poses, velocities, Jacobian, screws, singular poses."""
