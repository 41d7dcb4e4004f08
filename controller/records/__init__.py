"""What a controller keeps of itself: the file of a flight, and how regularly its loop ticked."""
