"""Every write and every child process of a command fails once: what is there stays whole, and one sentence says why."""
