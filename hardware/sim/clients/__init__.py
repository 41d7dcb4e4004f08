"""The simulated devices as other processes see them: bus, camera, clock, hand, referee."""
