"""What the manual makes from the code itself while it is built."""
