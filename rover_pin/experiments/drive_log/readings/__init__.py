"""What sensors, tracker and logger make of a drive: scatter, outlying or wandering poses, late rows."""
