"""What measurements share by chance beyond their noise: folds that differ, noise that drifts; how each is learnt."""
