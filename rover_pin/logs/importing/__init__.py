"""Recordings of others made into drive logs: read whatever the file is, guess the columns, cut into runs, write.

Start at `import_log`. `raw` reads files, `words` knows what columns are called, `guess` and its helpers decide which
column is what (every guess says why), `splitting` cuts at stops and gaps, `written` writes the folder.
"""
