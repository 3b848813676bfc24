"""Files read within bounds and written whole or not at all: tables, Parquet, TOML, samples, folders of results.

Start at `table` and `toml_file`; every reader opens files through `bounded`.
"""
