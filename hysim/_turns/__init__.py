"""Where an input turns: its turning points, cycles between them, repeated cycles, their drift, and its noise."""
