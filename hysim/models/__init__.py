"""Laws, plants and chain stages: frozen specifications, one family a file."""
