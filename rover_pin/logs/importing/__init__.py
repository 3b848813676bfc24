"""Recordings of others made into drive logs: read whatever the file is, choose what agrees, cut into runs, write.

Start at `import_log`. `files` reads them, `words` knows what columns are called, `clock`, `places` and `wheels` list
what each may be, `joint_choice` weighs them together by the calculus of `evidence`, `other_channels` adds the rest,
`column_matching` asks what stays open, `splitting` cuts at stops and gaps, `written` writes the folder.
"""
