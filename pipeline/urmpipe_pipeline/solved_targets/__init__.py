"""Inverse kinematics: targets from files and arrays, their solutions as a result, and its joint log."""
