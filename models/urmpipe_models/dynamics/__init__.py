"""The motion of an arm's masses: forces from motion, motion from forces, energies."""
