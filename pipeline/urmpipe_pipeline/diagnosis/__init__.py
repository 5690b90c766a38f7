"""Why two sides deviate: hypotheses of sign, structure, place and time, held against the deviation."""
