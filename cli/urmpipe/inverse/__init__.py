"""What `urmpipe.ik` is made of: what is asked, its solutions, and their words."""
