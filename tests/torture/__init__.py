"""The campaign that tries to break everything: `make torture`, see README.md."""
