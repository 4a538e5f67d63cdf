"""What is watched all the time, whatever a behaviour does: each limit with the event that it raises."""
