"""What stands on the table by what is seen alone: each thing by depth, any position, and where something may hide."""
