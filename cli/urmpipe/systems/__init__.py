"""What `urmpipe.simulate` is made of: blocks from robots, logs and units, and the result."""
