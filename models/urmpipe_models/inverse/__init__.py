"""Inverse kinematics: from where the tool shall be to the joint values that bring it there."""
