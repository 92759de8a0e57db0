"""Parameters that follow a channel of a record: models, and the structure that `hysim.identify` searches."""
