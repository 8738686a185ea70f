"""Jobs as users have them, timed against another revision."""
