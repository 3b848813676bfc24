"""For a controller of your own: a file of it, a drive sample by sample, the linear model at a trim point."""
