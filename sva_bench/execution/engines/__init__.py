"""What robots are driven in."""
