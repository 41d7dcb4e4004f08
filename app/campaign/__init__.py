"""Campaigns: many simulated games, drawn by seed over ranges, over cores and machines; and what they prove."""
