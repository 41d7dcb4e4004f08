"""One way to a rig: simulated, without devices, or a lab's."""
