"""Bringing a rig up: its devices checked, its camera calibrated, its link tested, its controller operated."""
