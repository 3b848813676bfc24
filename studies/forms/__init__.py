"""Laws that studies compare and that are not part of the package."""
