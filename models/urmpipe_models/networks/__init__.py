"""Kinematic networks: bodies, joints, constraint elements and controls; graph, assembly, mobility."""
