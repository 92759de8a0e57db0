"""What the columns of a record show: channels, turning points, cycles and their drift, noise, a sensor's quantum."""
