"""Readers of the ASL (EuRoC) layout, and the import from rosbags."""
