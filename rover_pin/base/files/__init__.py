"""Readers and writers of files: tables, Parquet, TOML, the package's sample data sets, and folders of results.

Readers refuse files that are larger than a maximum size. Writers replace a file in one step, so that no reader sees a
half-written file. Start at `table` and `toml_file`. Every reader opens its files through `bounded`.
"""
