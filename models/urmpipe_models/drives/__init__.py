"""What turns a joint: motor, gear and shaft, controller, set point."""
