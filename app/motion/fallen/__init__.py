"""Motions for pieces that lie or stand in the way: standing them up, pushing them aside."""
