"""What a campaign proves: its page, its comparison with an older one, and a gate for releases."""
