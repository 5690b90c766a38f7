"""`python -m urmpipe`."""

from urmpipe.main import main

main()
