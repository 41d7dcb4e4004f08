"""The controller's process: one tick after the other, and all that lives as long as it does."""
