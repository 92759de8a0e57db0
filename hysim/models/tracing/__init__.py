"""Steps and packs as data: the source of a step with the values of its names, and the arithmetic of a pack."""
