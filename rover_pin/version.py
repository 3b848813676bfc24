"""The version of the package. All other files read it from here."""

__version__ = "0.2.0"
