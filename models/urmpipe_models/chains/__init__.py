"""What an arm is: frames and joints, and the parameters that give them (URM, Denavit-Hartenberg, 6R)."""
