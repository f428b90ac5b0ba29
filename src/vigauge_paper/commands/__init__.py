"""The commands that the workflow's rules call."""
