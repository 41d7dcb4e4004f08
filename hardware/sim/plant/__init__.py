"""The plant itself: MuJoCo stepped by drive commands, its imperfections, its state on disk."""
