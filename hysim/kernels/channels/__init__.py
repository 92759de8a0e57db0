"""Laws whose parameters change from sample to sample."""
