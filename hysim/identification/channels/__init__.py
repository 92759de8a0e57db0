"""Parameters that depend on a channel: starts of their search, their curves, and channels that are not known."""
