"""Where the camera hangs and the board lies, seen from the robot's base."""
