"""Tools that know nothing of hysteresis: frozen arrays, files in one piece, printing, progress, threads."""
