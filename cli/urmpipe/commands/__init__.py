"""One file per command; each is a thin shell around one function of `urmpipe.api`."""
