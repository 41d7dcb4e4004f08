"""Who plays tasks: processes on this machine, or of a cluster; and what each of them does."""
