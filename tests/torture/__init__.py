"""What breaks: random scenes, damaged files and faults, seeded so that every find comes back."""
