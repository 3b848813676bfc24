"""Forms of laws that studies compare and the package does not keep."""
