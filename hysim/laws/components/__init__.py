"""Rules of structural components: what earthquake engineers calibrate to cyclic tests."""
