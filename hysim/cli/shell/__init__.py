"""The command line's dealings with the shell: completion, signals, and messages in its words."""
