"""Hard friction-contact problems, and how they are made: README.md."""
