"""What sensors, tracker and logger make of a drive: scatter, poses that stray or wander, rows that come late."""
