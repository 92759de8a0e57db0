"""The whole actuator to be identified: its parts, their coordinates, the columns of its output, and where to begin."""
