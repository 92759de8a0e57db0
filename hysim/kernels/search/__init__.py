"""Kernels that only a search takes: as good as it can tell, without the certified bounds of the laws' own steps."""
