"""What policies see, and what turns their commands into actions."""
