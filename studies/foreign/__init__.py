"""A drive in foreign words, units, clocks, frames and files. Nothing here shares code with the importer."""
