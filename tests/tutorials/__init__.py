"""The tutorials of the manual, run as a reader runs them."""
