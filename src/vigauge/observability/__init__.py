"""What no measurement sees."""
