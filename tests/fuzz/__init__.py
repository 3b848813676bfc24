"""A seeded fuzzer over every reader: valid inputs, mutated, must be accepted or refused by one clear sentence.

`mutations` changes bytes, text, tables, arrays and words; `valid` makes the inputs that are changed; `contract` reads
one and says what broke the contract; `run` does so with many, `test_fuzz` in the suite.
"""
