"""The wheel in empty environments: what it promises alone, and with each extra."""
