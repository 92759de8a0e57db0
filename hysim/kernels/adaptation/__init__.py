"""Laws whose parameters are estimated while they run: many copies for one sample, and an inverse that adapts."""
