"""What only figures, benches, tests and documents need: reference models, simulation, generated pages."""
