"""What stands where: the physical set, its places, and the transfers that a move or a set-up needs."""
