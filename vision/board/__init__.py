"""The board in a picture: found, followed, and seen from straight above."""
