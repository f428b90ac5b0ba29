"""The `vigauge` command."""
