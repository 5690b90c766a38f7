"""Kinematics of an arm: poses, velocities, Jacobian, screws; singularity; identification."""
