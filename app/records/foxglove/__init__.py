"""A game in 3-D, as Foxglove and Lichtblick show it without being told how: their own schemas, beside the telemetry."""
