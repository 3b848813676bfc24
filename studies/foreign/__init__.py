"""A drive in the words, units, clocks, frames and files of others; nothing here knows how a log is imported."""
