"""Around inverse kinematics: targets from files, joint logs, and runs of solutions."""
