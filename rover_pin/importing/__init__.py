"""Convert recordings of any program to drive logs: read them, match their columns to channels, cut them into runs,
write.

Start at `import_log.import_log`. The package `files` reads the files. `clock`, `own_clocks` and `lost_values` prepare
the rows. `places`, `wheels` and `other_channels` list the columns that may hold each channel, by their names and units.
`joint_choice` computes how probable each combination of columns is, with the Bayes factors of `evidence`.
`column_matching` takes the most probable combination, or asks the user. `splitting` cuts the recording into runs at
stops and gaps.
"""
