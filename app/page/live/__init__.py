"""What goes on now: state in sections, who watches, who holds the controls, telemetry."""
