"""Test beds: supervisor and plant in one process, and what benches and figures have done in them."""
