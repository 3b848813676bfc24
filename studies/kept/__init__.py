"""What a blind test keeps of its cases, so that a run that was stopped goes on."""
