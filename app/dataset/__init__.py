"""What was played, as demonstrations for robot learning: one episode a ply, in LeRobot's format or as MCAP."""
