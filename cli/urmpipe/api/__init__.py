"""The public functions, a module each; `urmpipe` exports them."""
