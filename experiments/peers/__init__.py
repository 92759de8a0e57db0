"""What the experiment `work_precision` measures, one problem a module, and how it measures."""
